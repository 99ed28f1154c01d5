//! How far an added mass is from symmetric, and how far two are apart.

use crate::adjoint::lie::{Mat6, Vec3};
use crate::geometry::Faces;

/// max |M − Mᵀ|_ij / √(M_ii M_jj), by [`scaled`].
pub(crate) fn asymmetry(m: &Mat6, faces: &Faces) -> f64 {
    scaled(&(m - m.transpose()), m, faces)
}

/// max |D_ij| / √(M_ii M_jj). A diagonal entry under a hundredth of the displaced fluid's own
/// inertia (a sphere's rotation) counts as that hundredth.
pub(crate) fn scaled(difference: &Mat6, m: &Mat6, faces: &Faces) -> f64 {
    let area = faces.area();
    let pairs = || faces.centres.iter().zip(&faces.areas);
    let middle = pairs().map(|(c, a)| c * *a).sum::<Vec3>() / area;
    let spread = pairs()
        .map(|(c, a)| (c - middle).norm_squared() * a)
        .sum::<f64>()
        / area;
    let volume = faces.volume();
    let diagonal = |i: usize| {
        let displaced = if i < 3 { volume } else { volume * spread };
        m[(i, i)].max(0.01 * displaced)
    };
    let mut worst = 0.0_f64;
    for i in 0..6 {
        for j in 0..6 {
            let scale = (diagonal(i) * diagonal(j)).sqrt();
            worst = worst.max(difference[(i, j)].abs() / scale);
        }
    }
    worst
}
