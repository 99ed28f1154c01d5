//! Flux: gradient.

use super::constant;
use crate::kernel::lane::{Lane, V3, cross, dot, scale, sub};
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;

/// Edge term `g_ab = c (r_a × e)`, from `r_a`, the edge `e = b − a`, its square and the lengths.
#[inline(always)]
pub(super) fn edge_gradient<T: Lane>(ra: V3<T>, e: V3<T>, e2: T, la: T, lb: T) -> V3<T> {
    let sum = la + lb;
    let c = (sum + sum) / (la * lb * sum.mul_add(sum, -e2));
    scale(c, cross(ra, e))
}

/// `weight · ∇_s Ω`.
pub fn flux_gradient(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> Vec3 {
    let mut gradient = Vec3::zeros();
    for c in 0..3 {
        let (a, b) = (corners[c], corners[(c + 1) % 3]);
        let s = [s.x, s.y, s.z];
        let ra = sub(constant(s[0], &a), s);
        let rb = sub(constant(s[0], &b), s);
        let e = b - a;
        let (la, lb) = (dot(ra, ra).sqrt(), dot(rb, rb).sqrt());
        gradient += Vec3::from(edge_gradient(
            ra,
            constant(s[0], &e),
            e.norm_squared(),
            la,
            lb,
        ));
    }
    weight * gradient
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn flux_vjp(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        let corners = targets.corners(i);
        for j in 0..sources.len() {
            let g = flux_gradient(&corners, targets.weight[i], &sources.point(j));
            for k in 0..columns {
                for c in 0..3 {
                    out[(j * columns + k) * 3 + c] += bar[i * columns + k] * g[c];
                }
            }
        }
    }
}
