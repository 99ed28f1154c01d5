//! Potential: gradient.

use crate::kernel::lane::{Lane, V3, dot, scale};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `r/|r|³`.
#[inline(always)]
pub(super) fn inverse_distance_gradient<T: Lane>(r: V3<T>) -> V3<T> {
    let r2 = dot(r, r);
    scale(r2.like(1.0) / (r2 * r2.sqrt()), r)
}

/// Gradient of [`potential`](super::potential()) in `s`.
pub fn potential_gradient(x: &Vec3, s: &Vec3) -> Vec3 {
    Vec3::from(inverse_distance_gradient((x - s).into()))
}

/// `out[j][k] += Σ_i bar[i][k] ∇P_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn potential_vjp(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        for j in 0..sources.len() {
            let g = potential_gradient(&targets.centre[i], &sources.point(j));
            for k in 0..columns {
                for c in 0..3 {
                    out[(j * columns + k) * 3 + c] += bar[i * columns + k] * g[c];
                }
            }
        }
    }
}
