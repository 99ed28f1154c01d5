//! Flux: tangent of the gradient.

use super::constant;
use crate::kernel::lane::{Lane, V3, cross, dot, scale, scale_add, sub};
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;

/// Tangent of [`edge_gradient`](super::vjp::edge_gradient) as the source moves by `d`, with the
/// tangents `dl` of the two lengths. With `c = 2 S/(P Q)`:
/// `δc = 2 (δS − S (δP Q + P δQ)/(P Q))/(P Q)`, `δP = δl_a l_b + l_a δl_b`, `δQ = 2 S δS`, and
/// `δr_a = −d`.
#[inline(always)]
pub(super) fn edge_gradient_tangent<T: Lane>(
    ra: V3<T>,
    e: V3<T>,
    e2: T,
    [la, lb]: [T; 2],
    d: V3<T>,
    [dla, dlb]: [T; 2],
) -> V3<T> {
    let (s, ds) = (la + lb, dla + dlb);
    let (p, dp) = (la * lb, dla.mul_add(lb, la * dlb));
    let q = s.mul_add(s, -e2);
    let inverse = la.like(2.0) / (p * q);
    let c = s * inverse;
    // c/2 (δP Q + 2 P S δS) = S (δP Q + P δQ)/(P Q)
    let slope = dp.mul_add(q, (p + p) * (s * ds)) * (la.like(-0.5) * c);
    let dc = (ds + slope) * inverse;
    scale_add(dc, cross(ra, e), scale(-c, cross(d, e)))
}

/// `weight · ∇∇Ω d`.
pub fn flux_hessian_product(corners: &[Vec3; 3], weight: f64, s: &Vec3, d: &Vec3) -> Vec3 {
    let mut product = Vec3::zeros();
    for c in 0..3 {
        let (a, b) = (corners[c], corners[(c + 1) % 3]);
        let (s, d) = ([s.x, s.y, s.z], [d.x, d.y, d.z]);
        let r = [a, b].map(|v| sub(constant(s[0], &v), s));
        let l = r.map(|r| dot(r, r).sqrt());
        let dl = [-dot(r[0], d) / l[0], -dot(r[1], d) / l[1]];
        let e = b - a;
        product += Vec3::from(edge_gradient_tangent(
            r[0],
            constant(s[0], &e),
            e.norm_squared(),
            l,
            d,
            dl,
        ));
    }
    weight * product
}

/// `out[j][k] += Σ_i bar[i][k] ∇∇K_ij d_j`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn flux_hvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    for i in 0..targets.len() {
        let corners = targets.corners(i);
        for j in 0..sources.len() {
            let g = flux_hessian_product(&corners, targets.weight[i], &sources.point(j), &d[j]);
            for k in 0..columns {
                for c in 0..3 {
                    out[(j * columns + k) * 3 + c] += bar[i * columns + k] * g[c];
                }
            }
        }
    }
}
