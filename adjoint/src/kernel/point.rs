//! Kernels between a source and a point: one set of fills and sums for all of them.

use super::lane::{Lane, Lanes, V3, sub};
use super::sum::{Scratch, TILE, Terms, dispatch, fill, load, put, splat};
use super::{Points, Sources, Write};
use pulp::{Simd, WithSimd};
use std::marker::PhantomData;

/// A function of `r = x − s` and of the point's normal `n`, which may carry the row weight, with its derivatives in the
/// position `s` of the source.
pub(super) trait PointKernel: Copy + Sync {
    /// Value.
    fn value_of<T: Lane>(n: V3<T>, r: V3<T>) -> T;
    /// Gradient in `s`.
    fn gradient_of<T: Lane>(n: V3<T>, r: V3<T>) -> V3<T>;
    /// Hessian in `s`, times `d`.
    fn hessian_product_of<T: Lane>(n: V3<T>, r: V3<T>, d: V3<T>) -> V3<T>;
}

/// What a sum takes of a kernel at each point: `C` components.
pub(super) trait Rung<const C: usize>: Copy + Sync {
    /// The components for a source that moves by `d`.
    fn of<T: Lane>(n: V3<T>, r: V3<T>, d: V3<T>) -> [T; C];
}

/// Values of a kernel.
#[derive(Clone, Copy)]
pub(super) struct Value<K>(pub K);

impl<K: PointKernel> Rung<1> for Value<K> {
    #[inline(always)]
    fn of<T: Lane>(n: V3<T>, r: V3<T>, _: V3<T>) -> [T; 1] {
        [K::value_of(n, r)]
    }
}

/// Gradients of a kernel.
#[derive(Clone, Copy)]
pub(super) struct Gradient<K>(pub K);

impl<K: PointKernel> Rung<3> for Gradient<K> {
    #[inline(always)]
    fn of<T: Lane>(n: V3<T>, r: V3<T>, _: V3<T>) -> V3<T> {
        K::gradient_of(n, r)
    }
}

/// Tangents of a kernel's gradients.
#[derive(Clone, Copy)]
pub(super) struct Tangent<K>(pub K);

impl<K: PointKernel> Rung<3> for Tangent<K> {
    #[inline(always)]
    fn of<T: Lane>(n: V3<T>, r: V3<T>, d: V3<T>) -> V3<T> {
        K::hessian_product_of(n, r, d)
    }
}

/// The terms of a sum: a rung at the points of a surface.
#[derive(Clone, Copy)]
pub(super) struct At<'a, R>(pub &'a Points, pub R);

impl<const C: usize, R: Rung<C>> Terms<C> for At<'_, R> {
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
        out: &mut [[S::f64s; C]; TILE],
    ) {
        let first = tile * TILE;
        let centres = &self.0.centre[first..];
        let normals = &self.0.weighted[first..];
        for ((out, centre), normal) in out.iter_mut().zip(centres).zip(normals) {
            let r = sub(splat(simd, centre), s);
            let term = R::of(splat(simd, normal), r, d);
            for (out, term) in out.iter_mut().zip(&term) {
                *out = term.v;
            }
        }
    }
}

/// Values of a kernel into `out[i · stride + column + j]`, targets × sources.
pub(super) fn point_fill<K: PointKernel>(
    _: K,
    targets: &Points,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    let len = targets.len();
    fill(len, sources, out, stride, column, TILE, |tile, out| {
        dispatch(Fill::<K> {
            kernel: PhantomData,
            targets,
            first: tile * TILE,
            sources,
            add: write == Write::Add,
            out,
            stride,
            column,
        });
    });
}

/// Some rows.
struct Fill<'a, K> {
    kernel: PhantomData<K>,
    targets: &'a Points,
    first: usize,
    sources: &'a Sources,
    add: bool,
    out: &'a mut [f64],
    stride: usize,
    column: usize,
}

impl<K: PointKernel> WithSimd for Fill<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let count = self.sources.len();
        for (i, row) in self.out.chunks_mut(self.stride).enumerate() {
            let centre = splat(simd, &self.targets.centre[self.first + i]);
            let normal = splat(simd, &self.targets.weighted[self.first + i]);
            for v in 0..count.div_ceil(S::F64_LANES) {
                let r = sub(centre, load(simd, self.sources, v));
                let value = K::value_of(normal, r);
                let j = v * S::F64_LANES;
                let end = count.min(j + S::F64_LANES);
                let out = &mut row[self.column + j..self.column + end];
                put(simd, self.add, value.v, out);
            }
        }
    }
}
