//! The flow that the solved sources make.
//!
//! With strengths a of all bodies' sources and those of their images (s_j, of the same strength behind rigid walls),
//!
//! ```text
//! φ(x) = Σ_j a_j / |x − s_j|        u(x) = −∇φ = Σ_j a_j (x − s_j) / |x − s_j|³
//! ```
//!
//! Bodies that don't feel each other are solved as if the other weren't there; the flow is the sum of theirs.

use super::Full;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Velocity at points (world frame) for body-frame twists of all bodies.
pub(super) fn velocity(
    full: &Full,
    poses: &[Pose],
    twists: &DVector<f64>,
    points: &[Vec3],
) -> Result<Vec<Vec3>> {
    let model = full.model();
    let column = DMatrix::from_column_slice(twists.len(), 1, twists.as_slice());
    let strengths = full.backend().respond(poses, &column)?.strengths()?;
    let mut sources: Vec<(Vec3, f64)> = Vec::with_capacity(model.images.len() * model.columns());
    for image in &model.images {
        for ((body, range), pose) in model.bodies.iter().zip(&model.sources).zip(poses) {
            let (rotation, shift) = image.placement(pose);
            let placed = body.boundary.sources.iter().map(|s| rotation * s + shift);
            sources.extend(placed.zip(strengths.slice(range.start, range.end).iter().copied()));
        }
    }
    let at = |x: &Vec3| {
        let mut out = Vec3::zeros();
        for (s, a) in &sources {
            let r = x - s;
            let square = r.norm_squared();
            out += r * (a / (square * square.sqrt()));
        }
        out
    };
    Ok(points.par_iter().map(at).collect())
}
