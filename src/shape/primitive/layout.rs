//! What all patterns choose their numbers of cells by.

use hydrograd_adjoint::lie::Vec3;

/// Vertices, m, and faces.
pub(super) type Parts = (Vec<Vec3>, Vec<[usize; 3]>);

/// How far a number of faces and the stretch of the cells are from what was asked: the pattern
/// with the least is taken. The count weighs more; `stretch` are ratios, 1 for none.
pub(super) fn misfit(faces: f64, target: f64, stretch: &[f64]) -> f64 {
    let count = (faces / target).ln() * 10.0;
    count * count + stretch.iter().map(|s| s.ln() * s.ln()).sum::<f64>()
}
