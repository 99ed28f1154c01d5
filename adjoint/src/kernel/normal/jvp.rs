//! Normal velocity: tangent.

use super::normal_gradient;
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn normal_jvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        let (x, n) = (&targets.centre[i], &targets.normal[i]);
        for j in 0..sources.len() {
            let g = normal_gradient(x, n, targets.weight[i], &sources.point(j)).dot(&d[j]);
            for k in 0..columns {
                out[i * columns + k] += a[j * columns + k] * g;
            }
        }
    }
}
