//! Normal velocity: tangent of the gradient.

use crate::kernel::lane::{Lane, Lanes, V3, dot, scale, scale_add, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, registers, splat, transposed};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;
use pulp::Simd;

/// `3 (5 (n·r)(r·d) r/r² − (r·d) n − (n·d) r − (n·r) d)/r⁵`; `n` may carry the row weight.
#[inline(always)]
pub(super) fn velocity_hessian_product<T: Lane>(n: V3<T>, r: V3<T>, d: V3<T>) -> V3<T> {
    let r2 = dot(r, r);
    let inverse = r2.like(1.0) / r2;
    let inverse2 = inverse * inverse;
    let c = r2.like(3.0) * inverse2 * inverse * r2.sqrt();
    let (nr, rd, nd) = (dot(n, r), dot(r, d), dot(n, d));
    let along = (r2.like(5.0) * inverse * nr).mul_add(rd, -nd);
    scale_add(c * along, r, scale_add(-(c * rd), n, scale(-(c * nr), d)))
}

/// Hessian of [`normal`](super::normal()) in `s`, times `d`.
pub fn normal_hessian_product(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3, d: &Vec3) -> Vec3 {
    let (n, r, d) = ((*n).into(), (x - s).into(), (*d).into());
    weight * Vec3::from(velocity_hessian_product(n, r, d))
}

/// `out[j][k] += Σ_i bar[i][k] ∇∇K_ij d_j`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn normal_hvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Tangents(targets), sources, Some(d), bar, columns, out);
}

/// Tangents of the gradients at the points of a surface.
#[derive(Clone, Copy)]
struct Tangents<'a>(&'a Points);

impl Terms<3> for Tangents<'_> {
    fn len(self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        d: V3<Lanes<S>>,
        _: &mut Scratch<S>,
        out: &mut [[S::f64s; 3]; TILE],
    ) {
        let first = tile * TILE;
        let centres = &self.0.centre[first..];
        let normals = &self.0.weighted[first..];
        for ((out, centre), normal) in out.iter_mut().zip(centres).zip(normals) {
            let r = sub(splat(simd, centre), s);
            *out = registers(velocity_hessian_product(splat(simd, normal), r, d));
        }
    }
}
