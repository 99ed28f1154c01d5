//! Flux: tangent of the gradient.

use super::constant;
use super::vjp::edge_weights;
use crate::kernel::lane::{Lane, Lanes, V3, cross, dot, scale, scale_add, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, length, registers, splat, transposed};
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;
use pulp::Simd;

/// Tangent of [`edge_gradient`](super::vjp::edge_gradient) as the source moves by `d`, with the
/// tangents `dl` of the two lengths. With `c = 2 S/(P Q)`:
/// `δc = 2 (δS − S (δP Q + P δQ)/(P Q))/(P Q)`, `δP = δl_a l_b + l_a δl_b`, `δQ = 2 S δS`, and
/// `δr_a = −d`.
#[inline(always)]
pub(in crate::kernel) fn edge_gradient_tangent<T: Lane>(
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
    let weight = edge_weights(targets, bar, columns);
    transposed(
        EdgeTangents(targets),
        sources,
        Some(d),
        &weight,
        columns,
        out,
    );
}

/// Tangents of the edge terms of a surface.
#[derive(Clone, Copy)]
struct EdgeTangents<'a>(&'a Triangles);

impl Terms<3> for EdgeTangents<'_> {
    fn len(self) -> usize {
        self.0.sides.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        d: V3<Lanes<S>>,
        scratch: &mut Scratch<S>,
        out: &mut [[S::f64s; 3]; TILE],
    ) {
        let tile = &self.0.edges[tile];
        let [lengths, tangents] = scratch;
        let table = lengths.iter_mut().zip(tangents.iter_mut());
        for ((l, dl), vertex) in table.zip(&tile.vertices) {
            let r = sub(splat(simd, vertex), s);
            let length = length(r);
            *l = length.v;
            // δl = −r·d/l
            *dl = (-dot(r, d) / length).v;
        }
        for (out, edge) in out.iter_mut().zip(&tile.items) {
            let [a, b] = edge.ends;
            let (a, b) = (a as usize, b as usize);
            *out = registers(edge_gradient_tangent(
                sub(splat(simd, &edge.start), s),
                splat(simd, &edge.along),
                Lanes::splat(simd, edge.squared),
                [Lanes::new(simd, lengths[a]), Lanes::new(simd, lengths[b])],
                d,
                [Lanes::new(simd, tangents[a]), Lanes::new(simd, tangents[b])],
            ));
        }
    }
}
