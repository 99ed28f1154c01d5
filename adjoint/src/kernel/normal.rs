//! Normal velocity of a point source at points of a surface, `w_i n_i·r/|r|³` with `r = x_i − s`
//! (the paper's Eq. 18).
//!
//! ```text
//! ∇_s K   = w (3 (n·r) r/r² − n)/r³
//! ∇∇K d   = 3 w (5 (n·r)(r·d) r/r² − (r·d) n − (n·d) r − (n·r) d)/r⁵
//! ```

use super::lane::{Lane, V3, dot, scale, scale_add};
use super::point::{At, Gradient, PointKernel, Tangent, point_fill};
use super::sum::{forward, transposed};
use super::{Points, Sources, Write};
use crate::lie::Vec3;

#[derive(Clone, Copy)]
pub(super) struct Normal;

impl PointKernel for Normal {
    /// `n·r/|r|³`.
    #[inline(always)]
    fn value_of<T: Lane>(n: V3<T>, r: V3<T>) -> T {
        let r2 = dot(r, r);
        dot(n, r) / (r2 * r2.sqrt())
    }

    /// `(3 (n·r) r/r² − n)/r³`.
    #[inline(always)]
    fn gradient_of<T: Lane>(n: V3<T>, r: V3<T>) -> V3<T> {
        let r2 = dot(r, r);
        let inverse = r2.like(1.0) / r2;
        let inverse3 = inverse * r2.sqrt() * inverse;
        let c = dot(n, r) * (r2.like(3.0) * inverse * inverse3);
        scale_add(c, r, scale(-inverse3, n))
    }

    /// `3 (5 (n·r)(r·d) r/r² − (r·d) n − (n·d) r − (n·r) d)/r⁵`.
    #[inline(always)]
    fn hessian_product_of<T: Lane>(n: V3<T>, r: V3<T>, d: V3<T>) -> V3<T> {
        let r2 = dot(r, r);
        let inverse = r2.like(1.0) / r2;
        let inverse2 = inverse * inverse;
        let c = r2.like(3.0) * inverse2 * inverse * r2.sqrt();
        let (nr, rd, nd) = (dot(n, r), dot(r, d), dot(n, d));
        let along = (r2.like(5.0) * inverse * nr).mul_add(rd, -nd);
        scale_add(c * along, r, scale_add(-(c * rd), n, scale(-(c * nr), d)))
    }
}

/// `weight n·(x − s)/|x − s|³`.
pub fn normal(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3) -> f64 {
    weight * Normal::value_of((*n).into(), (x - s).into())
}

/// Gradient of [`normal`](normal()) in `s`.
pub fn normal_gradient(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3) -> Vec3 {
    weight * Vec3::from(Normal::gradient_of((*n).into(), (x - s).into()))
}

/// Hessian of [`normal`](normal()) in `s`, times `d`.
pub fn normal_hessian_product(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3, d: &Vec3) -> Vec3 {
    let (n, r, d) = ((*n).into(), (x - s).into(), (*d).into());
    weight * Vec3::from(Normal::hessian_product_of(n, r, d))
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn normal_fill(
    targets: &Points,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    point_fill(Normal, targets, sources, write, out, stride, column);
}

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn normal_jvp(
    targets: &Points,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let terms = At(targets, Gradient(Normal));
    forward(terms, sources, d, a, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn normal_vjp(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let terms = At(targets, Gradient(Normal));
    transposed(terms, sources, None, bar, columns, out);
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
    let terms = At(targets, Tangent(Normal));
    transposed(terms, sources, Some(d), bar, columns, out);
}
