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

/// How far a number of faces and the stretch of the cells are from what was asked: the pattern
/// with the least is taken. The count weighs more; `stretch` are ratios, 1 for none.
fn misfit(faces: f64, target: f64, stretch: &[f64]) -> f64 {
    let count = (faces / target).ln() * 10.0;
    count * count + stretch.iter().map(|s| s.ln() * s.ln()).sum::<f64>()
}
