//! Flux: gradient.

use super::constant;
use crate::kernel::lane::{Lane, Lanes, V3, cross, dot, scale, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, length, registers, splat, transposed};
use crate::kernel::target::NONE;
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;
use pulp::Simd;

/// Edge term `g_ab = c (r_a × e)`, from `r_a`, the edge `e = b − a`, its square and the lengths.
#[inline(always)]
pub(in crate::kernel) fn edge_gradient<T: Lane>(ra: V3<T>, e: V3<T>, e2: T, la: T, lb: T) -> V3<T> {
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
    let weight = edge_weights(targets, bar, columns);
    transposed(EdgeGradients(targets), sources, None, &weight, columns, out);
}

/// Cotangents of the edge terms from those of the rows: left less right, `[edge][k]`.
pub(super) fn edge_weights(targets: &Triangles, bar: &[f64], columns: usize) -> Vec<f64> {
    assert_eq!(bar.len(), targets.len() * columns, "bar: [target][k]");
    let mut weight = Vec::with_capacity(targets.sides.len() * columns);
    for side in &targets.sides {
        let left = side.left as usize;
        let row = &bar[left * columns..][..columns];
        let start = weight.len();
        weight.extend(row.iter().map(|b| targets.weights()[left] * b));
        if side.right != NONE {
            let right = side.right as usize;
            for (w, b) in weight[start..].iter_mut().zip(&bar[right * columns..]) {
                *w -= targets.weights()[right] * b;
            }
        }
    }
    weight
}

/// The edge terms of a surface.
#[derive(Clone, Copy)]
pub(super) struct EdgeGradients<'a>(pub &'a Triangles);

impl Terms<3> for EdgeGradients<'_> {
    fn len(self) -> usize {
        self.0.sides.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        _: V3<Lanes<S>>,
        scratch: &mut Scratch<S>,
        out: &mut [[S::f64s; 3]; TILE],
    ) {
        let tile = &self.0.edges[tile];
        let [lengths, _] = scratch;
        for (l, vertex) in lengths.iter_mut().zip(&tile.vertices) {
            *l = length(sub(splat(simd, vertex), s)).v;
        }
        for (out, edge) in out.iter_mut().zip(&tile.items) {
            let [a, b] = edge.ends;
            *out = registers(edge_gradient(
                sub(splat(simd, &edge.start), s),
                splat(simd, &edge.along),
                Lanes::splat(simd, edge.squared),
                Lanes::new(simd, lengths[a as usize]),
                Lanes::new(simd, lengths[b as usize]),
            ));
        }
    }
}
