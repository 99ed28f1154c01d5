//! Normal velocity: gradient.

use crate::kernel::lane::{Lane, Lanes, V3, dot, scale, scale_add, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, registers, splat, transposed};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;
use pulp::Simd;

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
    transposed(Gradients(targets), sources, None, bar, columns, out);
}

/// Gradients at the points of a surface.
#[derive(Clone, Copy)]
pub(super) struct Gradients<'a>(pub(super) &'a Points);

impl Terms<3> for Gradients<'_> {
    fn len(self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        _: V3<Lanes<S>>,
        _: &mut Scratch<S>,
        out: &mut [[S::f64s; 3]; TILE],
    ) {
        let first = tile * TILE;
        let centres = &self.0.centre[first..];
        let normals = &self.0.weighted[first..];
        for ((out, centre), normal) in out.iter_mut().zip(centres).zip(normals) {
            let r = sub(splat(simd, centre), s);
            *out = registers(velocity_gradient(splat(simd, normal), r));
        }
    }
}
