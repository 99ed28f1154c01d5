//! How a compressed body changes with its shape.
//!
//! Proxies, points and the body's own flow move with the shape; which sources were chosen stays. What is fitted then is a smooth function of the shape, and its
//! derivative is taken from two fits of the shape a little smaller and a little larger:
//!
//! ```text
//! Ū = P W Φ_own,   S̄ = P (W Φ W) Pᵀ,   P = (W E_x̄)⁺
//! ```
//!
//! S̄ is that of all modes of the solution, those too that compression leaves out: they are under its tolerance.

use super::super::views::dense;
use super::super::{Region, ShapeSlope};
use super::proxies::Proxies;
use super::pursuit::least_squares;
use super::{Chosen, CompressSettings, choose, potentials_weighted, symmetrise};
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::Response;
use crate::geometry::TriMesh;
use crate::{Error, Result};
use faer::Mat;
use nalgebra::DMatrix;

/// Part of a body's radius within which points are the same.
const SAME: f64 = 1e-9;

/// A body's shape a little changed, to both sides.
pub struct ShapeStep<'a> {
    /// Change of the parameter.
    pub step: f64,
    /// Velocity of a point of the body (m, its frame) per unit of the parameter.
    pub velocity: &'a dyn Fn(&Vec3) -> Vec3,
    /// What the body answers with the parameter changed by so much.
    pub response: &'a dyn Fn(f64) -> Result<Box<dyn Response>>,
    /// Derivative of the body's own added mass, known by itself.
    pub added_mass: Mat6,
}

/// Derivatives of what [`compress`](super::compress()) makes of the same arguments, one for each of `steps`; `made` are the points that it chose.
///
/// # Errors
/// As there, and where other points are chosen now: what was made may come from another machine.
pub fn slopes(
    name: &str,
    mesh: &TriMesh,
    made: &[Vec3],
    response: &dyn Response,
    settings: &CompressSettings,
    regions: &[Region],
    steps: &[ShapeStep],
) -> Result<Vec<ShapeSlope>> {
    let chosen = choose(name, mesh, response, settings, regions)?;
    let near = SAME * chosen.ball.radius;
    let same = |(a, b): (&Vec3, &Vec3)| (a - b).norm() <= near;
    if made.len() != chosen.points.len() || !made.iter().zip(&chosen.points).all(same) {
        return Err(Error::Unresolved {
            place: format!("body {name:?}: how its compression changes with its shape"),
            quantity: "compressed sources, of which others are chosen now".into(),
            value: chosen.points.len() as f64,
            limit: made.len() as f64,
            remedy: "the compressed body was kept by another machine or program: empty the folder in which compressed bodies are kept".into(),
        });
    }
    steps.iter().map(|step| slope(&chosen, step)).collect()
}

fn slope(chosen: &Chosen, step: &ShapeStep) -> Result<ShapeSlope> {
    let at = |t: f64| refit(chosen, step, t, (step.response)(t)?.as_ref());
    let (above, below) = (at(step.step)?, at(-step.step)?);
    let rate = |a: DMatrix<f64>, b: DMatrix<f64>| (a - b) / (2.0 * step.step);
    Ok(ShapeSlope {
        points: chosen.points.iter().map(step.velocity).collect(),
        strengths: rate(above.0, below.0),
        solution: rate(above.1, below.1),
        added_mass: step.added_mass,
    })
}

/// Ū and S̄ of the shape changed by `t`.
fn refit(
    chosen: &Chosen,
    step: &ShapeStep,
    t: f64,
    response: &dyn Response,
) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
    let moved = |points: &[Vec3]| -> Vec<Vec3> {
        points.iter().map(|p| p + t * (step.velocity)(p)).collect()
    };
    let proxies = Proxies {
        points: moved(&chosen.fitted.points),
        distances: chosen.fitted.distances.clone(),
    };
    let field = potentials_weighted(&proxies, &moved(&chosen.points)) * &chosen.spread;
    let strengths = least_squares(&field, &proxies.radiated(response)?);
    let mut scattered = proxies.scattered(response)?;
    symmetrise(&mut scattered);
    let half = least_squares(&field, &scattered);
    let solution = least_squares(&field, &half.transpose().to_owned());
    let spread = &chosen.spread;
    let solution: Mat<f64> = spread * solution * spread.transpose();
    Ok((dense(&(spread * strengths)), dense(&solution)))
}
