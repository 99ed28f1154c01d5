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
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::Response;
use crate::geometry::TriMesh;
use faer::Mat;
use nalgebra::DMatrix;

/// A body's shape a little changed, to both sides.
pub struct ShapeStep<'a> {
    /// Change of the parameter.
    pub step: f64,
    /// Velocity of a point of the body (m, its frame) per unit of the parameter.
    pub velocity: &'a dyn Fn(&Vec3) -> Vec3,
    /// What the body answers with the parameter larger by the step, and smaller.
    pub responses: [Box<dyn Response>; 2],
    /// Derivative of the body's own added mass, known by itself.
    pub added_mass: Mat6,
}

/// Derivatives of what [`compress`](super::compress()) makes of the same arguments, one for each of `steps`.
///
/// # Errors
/// As there.
pub fn slopes(
    name: &str,
    mesh: &TriMesh,
    response: &dyn Response,
    settings: &CompressSettings,
    regions: &[Region],
    steps: &[ShapeStep],
) -> Result<Vec<ShapeSlope>> {
    let chosen = choose(name, mesh, response, settings, regions)?;
    steps.iter().map(|step| slope(&chosen, step)).collect()
}

fn slope(chosen: &Chosen, step: &ShapeStep) -> Result<ShapeSlope> {
    let [larger, smaller] = &step.responses;
    let above = refit(chosen, step, step.step, larger.as_ref())?;
    let below = refit(chosen, step, -step.step, smaller.as_ref())?;
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
