//! Potential: tangent of the gradient.

use crate::kernel::lane::{Lane, V3, dot, scale, scale_add};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;

/// `(3 (r·d) r/r² − d)/r³`.
#[inline(always)]
pub(super) fn inverse_distance_hessian_product<T: Lane>(r: V3<T>, d: V3<T>) -> V3<T> {
    let r2 = dot(r, r);
    let inverse = r2.like(1.0) / r2;
    let inverse3 = inverse * r2.sqrt() * inverse;
    let c = r2.like(3.0) * inverse * inverse3 * dot(r, d);
    scale_add(c, r, scale(-inverse3, d))
}

/// Hessian of [`potential`](super::potential()) in `s`, times `d`.
pub fn potential_hessian_product(x: &Vec3, s: &Vec3, d: &Vec3) -> Vec3 {
    Vec3::from(inverse_distance_hessian_product(
        (x - s).into(),
        (*d).into(),
    ))
}

/// `out[j][k] += Σ_i bar[i][k] ∇∇P_ij d_j`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn potential_hvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        for j in 0..sources.len() {
            let g = potential_hessian_product(&targets.centre[i], &sources.point(j), &d[j]);
            for k in 0..columns {
                for c in 0..3 {
                    out[(j * columns + k) * 3 + c] += bar[i * columns + k] * g[c];
                }
            }
        }
    }
}
