//! Shapes by formula, as meshes: vertices on the exact surface, faces near-equilateral, and
//! mirror images of each other in x, y and z (prisms: in x), so that the mesh adds no coupling that
//! the shape doesn't have.

pub(super) mod cuboid;
mod planar;
pub(super) mod prism;
pub(super) mod revolved;
pub(super) mod sphere;

use hydrograd_adjoint::lie::Vec3;

/// Vertices, m, and faces.
type Parts = (Vec<Vec3>, Vec<[usize; 3]>);

/// How much of the cosine spacing is mixed in: cells at an edge are half as wide as even ones,
/// those in the middle 1.29 times.
const GRADING: f64 = 0.5;

/// Where the line at `t` (−1 … 1) of an even grid goes in one that is finer towards both edges, where the flow is sharp. Exactly odd, ±1 to ±1.
fn graded(t: f64) -> f64 {
    (1.0 - GRADING) * t + GRADING * (std::f64::consts::FRAC_PI_2 * t).sin()
}

/// How far a number of faces and the stretch of the cells are from what was asked: the pattern
/// with the least is taken. The count weighs more; `stretch` are ratios, 1 for none.
fn misfit(faces: f64, target: f64, stretch: &[f64]) -> f64 {
    let count = (faces / target).ln() * 10.0;
    count * count + stretch.iter().map(|s| s.ln() * s.ln()).sum::<f64>()
}
