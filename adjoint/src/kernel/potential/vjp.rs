//! Potential: gradient.

use crate::kernel::lane::{Lane, Lanes, V3, dot, scale, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, registers, splat, transposed};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;
use pulp::Simd;

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
        for (out, centre) in out.iter_mut().zip(centres) {
            let r = sub(splat(simd, centre), s);
            *out = registers(inverse_distance_gradient(r));
        }
    }
}
