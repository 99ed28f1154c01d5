//! Potential: tangent of the gradient.

use crate::kernel::lane::{Lane, Lanes, V3, dot, scale, scale_add, sub};
use crate::kernel::sum::{Scratch, TILE, Terms, registers, splat, transposed};
use crate::kernel::{Points, Sources};
use crate::lie::Vec3;
use pulp::Simd;

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
        for (out, centre) in out.iter_mut().zip(centres) {
            let r = sub(splat(simd, centre), s);
            *out = registers(inverse_distance_hessian_product(r, d));
        }
    }
}
