//! Normal velocity: gradient.

use crate::kernel::lane::{Lane, V3, dot, scale, scale_add};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `(3 (n·r) r/r² − n)/r³`; `n` may carry the row weight.
#[inline(always)]
pub(super) fn velocity_gradient<T: Lane>(n: V3<T>, r: V3<T>) -> V3<T> {
    let r2 = dot(r, r);
    let inverse = r2.like(1.0) / r2;
    let inverse3 = inverse * r2.sqrt() * inverse;
    let c = dot(n, r) * (r2.like(3.0) * inverse * inverse3);
    scale_add(c, r, scale(-inverse3, n))
}

/// Gradient of [`normal`](super::normal()) in `s`.
pub fn normal_gradient(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3) -> Vec3 {
    weight * Vec3::from(velocity_gradient((*n).into(), (x - s).into()))
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn normal_vjp(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        let (x, n) = (&targets.centre[i], &targets.normal[i]);
        for j in 0..sources.len() {
            let g = normal_gradient(x, n, targets.weight[i], &sources.point(j));
            for k in 0..columns {
                for c in 0..3 {
                    out[(j * columns + k) * 3 + c] += bar[i * columns + k] * g[c];
                }
            }
        }
    }
}
