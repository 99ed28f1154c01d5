//! Flux: tangent.

use super::flux_gradient;
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn flux_jvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        let corners = targets.corners(i);
        for j in 0..sources.len() {
            let g = flux_gradient(&corners, targets.weight[i], &sources.point(j)).dot(&d[j]);
            for k in 0..columns {
                out[i * columns + k] += a[j * columns + k] * g;
            }
        }
    }
}
