//! Potential of a point source at points, `1/|r|` with `r = x_i − s`; normals and row weights of the points don't
//! matter.
//!
//! ```text
//! ∇_s P = r/r³
//! ∇∇P d = (3 (r·d) r/r² − d)/r³
//! ```

use super::lane::{Lane, V3, dot, scale, scale_add};
use super::point::{At, Gradient, PointKernel, Tangent, Value, point_fill};
use super::sum::{forward, length, transposed};
use super::{Points, Sources, Write};
use crate::lie::Vec3;

#[derive(Clone, Copy)]
pub(super) struct Potential;

impl PointKernel for Potential {
    /// `1/|r|`.
    #[inline(always)]
    fn value_of<T: Lane>(_: V3<T>, r: V3<T>) -> T {
        r[0].like(1.0) / length(r)
    }

    /// `r/|r|³`.
    #[inline(always)]
    fn gradient_of<T: Lane>(_: V3<T>, r: V3<T>) -> V3<T> {
        let r2 = dot(r, r);
        scale(r2.like(1.0) / (r2 * r2.sqrt()), r)
    }

    /// `(3 (r·d) r/r² − d)/r³`.
    #[inline(always)]
    fn hessian_product_of<T: Lane>(_: V3<T>, r: V3<T>, d: V3<T>) -> V3<T> {
        let r2 = dot(r, r);
        let inverse = r2.like(1.0) / r2;
        let inverse3 = inverse * r2.sqrt() * inverse;
        let c = r2.like(3.0) * inverse * inverse3 * dot(r, d);
        scale_add(c, r, scale(-inverse3, d))
    }
}

/// No normal.
const NONE: V3<f64> = [0.0; 3];

/// `1/|x − s|`.
pub fn potential(x: &Vec3, s: &Vec3) -> f64 {
    Potential::value_of(NONE, (x - s).into())
}

/// Gradient of [`potential`](potential()) in `s`.
pub fn potential_gradient(x: &Vec3, s: &Vec3) -> Vec3 {
    Vec3::from(Potential::gradient_of(NONE, (x - s).into()))
}

/// Hessian of [`potential`](potential()) in `s`, times `d`.
pub fn potential_hessian_product(x: &Vec3, s: &Vec3, d: &Vec3) -> Vec3 {
    let (r, d) = ((x - s).into(), (*d).into());
    Vec3::from(Potential::hessian_product_of(NONE, r, d))
}

/// `P_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn potential_fill(
    targets: &Points,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    point_fill(Potential, targets, sources, write, out, stride, column);
}

/// `out[j][k] += Σ_i bar[i][k]/|x_i − s_j|`; `bar` is `[target][k]`, `out` is `[source][k]`.
pub fn potential_sum(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let terms = At(targets, Value(Potential));
    transposed(terms, sources, None, bar, columns, out);
}

/// `out[i][k] += Σ_j (∇P_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn potential_jvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let terms = At(targets, Gradient(Potential));
    forward(terms, sources, d, a, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇P_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn potential_vjp(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let terms = At(targets, Gradient(Potential));
    transposed(terms, sources, None, bar, columns, out);
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
    let terms = At(targets, Tangent(Potential));
    transposed(terms, sources, Some(d), bar, columns, out);
}
