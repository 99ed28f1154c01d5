//! Sums over targets or sources, shared by all kernels.
//!
//! A sum runs over *terms* (points of a surface, or edges of its triangles), taken in tiles of
//! [`TILE`]. The lanes of a vector are sources. A kernel evaluates one tile for one vector of
//! sources into a buffer; the sum then spends its columns on that buffer, so that the kernel is
//! evaluated once whatever the number of columns.
//!
//! The division into tiles and tasks is fixed and every number is added up within one task in one
//! order: results do not depend on the number of threads.

use super::lane::{Lane, Lanes, V3, dot};
use super::source::{Sources, WIDTH};
use crate::count::PAIRS;
use crate::lie::Vec3;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Runs `op` with the widest vectors of this processor.
pub(crate) fn dispatch(op: impl WithSimd<Output = ()>) {
    #[cfg(test)]
    match super::tests::VECTORS.load(std::sync::atomic::Ordering::Relaxed) {
        1 => return Simd::vectorize(pulp::Scalar, op),
        #[cfg(target_arch = "x86_64")]
        4 => {
            if let Some(simd) = pulp::x86::V3::try_new() {
                return Simd::vectorize(simd, op);
            }
        }
        _ => {}
    }
    Arch::new().dispatch(op);
}

/// Terms evaluated at once.
pub(super) const TILE: usize = 64;
/// Sources of one task of [`transposed`].
const CHUNK: usize = 4 * WIDTH;
/// Pairs that take as long as waking another thread, some times over (about 0.1 ms).
const WORTH_WAKING: usize = 100_000;
/// Vectors of sources whose terms [`forward`] keeps before it spends the columns on them.
const GROUP: usize = 2;

/// Keeps the buffers on cache lines, so that no vector straddles two.
#[repr(align(64))]
pub(super) struct Aligned<T>(pub T);

/// Room for the distances of a source vector from the vertices of a tile, and for their tangents.
pub(super) type Scratch<S> = [[<S as Simd>::f64s; 2 * TILE]; 2];

/// Terms of a sum with `C` components (a value or a gradient), functions of one source.
pub(super) trait Terms<const C: usize>: Copy + Sync {
    /// Number of terms.
    fn len(self) -> usize;

    /// Evaluates the terms `TILE · tile ..` for the sources `s`, displaced along `d` where the
    /// kernel is a tangent.
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        d: V3<Lanes<S>>,
        scratch: &mut Scratch<S>,
        out: &mut [[S::f64s; C]; TILE],
    );
}

/// Gives `task` the numbered chunks of `out`, on several threads where there are so many pairs that it pays
/// to wake them.
pub(super) fn parts<T: Send>(
    out: &mut [T],
    size: usize,
    pairs: usize,
    task: impl Fn(usize, &mut [T]) + Sync,
) {
    if pairs < WORTH_WAKING {
        let chunks = out.chunks_mut(size).enumerate();
        chunks.for_each(|(n, out)| task(n, out));
    } else {
        let chunks = out.par_chunks_mut(size).enumerate();
        chunks.for_each(|(n, out)| task(n, out));
    }
}

/// Terms of a tile.
fn tile_range(tile: usize, len: usize) -> Range<usize> {
    tile * TILE..((tile + 1) * TILE).min(len)
}

/// `v`-th vector of three coordinates.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, s: &Sources, v: usize) -> V3<Lanes<S>> {
    [
        Lanes::new(simd, S::as_simd_f64s(&s.x).0[v]),
        Lanes::new(simd, S::as_simd_f64s(&s.y).0[v]),
        Lanes::new(simd, S::as_simd_f64s(&s.z).0[v]),
    ]
}

/// `out[j][k][c] += Σ_i weight[i][k] term_i(s_j)[c]` over terms `i`.
pub(super) fn transposed<const C: usize>(
    terms: impl Terms<C>,
    sources: &Sources,
    d: Option<&[Vec3]>,
    weight: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    assert_eq!(weight.len(), terms.len() * columns, "weights: [target][k]");
    assert_eq!(out.len(), sources.len() * columns * C, "out: [source][k]");
    if out.is_empty() {
        return;
    }
    let d = d.map(|d| {
        assert_eq!(d.len(), sources.len(), "one displacement per source");
        Sources::new(d)
    });
    let pairs = terms.len() * sources.len();
    PAIRS.add(pairs);
    parts(out, CHUNK * columns * C, pairs, |chunk, out| {
        dispatch(Transposed {
            terms,
            sources,
            d: d.as_ref(),
            weight,
            columns,
            chunk,
            out,
        });
    });
}

struct Transposed<'a, const C: usize, T> {
    terms: T,
    sources: &'a Sources,
    d: Option<&'a Sources>,
    weight: &'a [f64],
    columns: usize,
    chunk: usize,
    out: &'a mut [f64],
}

impl<const C: usize, T: Terms<C>> WithSimd for Transposed<'_, C, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let k = self.columns;
        let zero = simd.splat_f64s(0.0);
        let first = self.chunk * CHUNK / S::F64_LANES;
        let count = self.out.len() / (k * C);
        let vectors = count.div_ceil(S::F64_LANES);
        let mut sums = vec![zero; vectors * k * C];
        let mut scratch = Aligned([[zero; 2 * TILE]; 2]);
        let mut buffer = Aligned([[zero; C]; TILE]);
        let len = self.terms.len();
        for tile in 0..len.div_ceil(TILE) {
            let range = tile_range(tile, len);
            let weight = &self.weight[range.start * k..range.end * k];
            for (v, sums) in sums.chunks_exact_mut(k * C).enumerate() {
                let s = load(simd, self.sources, first + v);
                let d = match self.d {
                    Some(d) => load(simd, d, first + v),
                    None => [Lanes::new(simd, zero); 3],
                };
                self.terms
                    .evaluate(simd, tile, s, d, &mut scratch.0, &mut buffer.0);
                spend(simd, &buffer.0[..range.len()], weight, k, sums);
            }
        }
        let sums: &[f64] = pulp::bytemuck::cast_slice(&sums);
        for (j, out) in self.out.chunks_exact_mut(k * C).enumerate() {
            let (v, lane) = (j / S::F64_LANES, j % S::F64_LANES);
            for (n, out) in out.iter_mut().enumerate() {
                *out += sums[(v * k * C + n) * S::F64_LANES + lane];
            }
        }
    }
}

/// `sums[k] += Σ_i weight[i][k] terms[i]`, a few columns at a time so that their sums stay in
/// registers.
#[inline(always)]
fn spend<S: Simd, const C: usize>(
    simd: S,
    terms: &[[S::f64s; C]],
    weight: &[f64],
    k: usize,
    sums: &mut [S::f64s],
) {
    let blocks = k.div_ceil(4);
    let mut from = 0;
    for block in 0..blocks {
        let to = (block + 1) * k / blocks;
        let sums = &mut sums[from * C..to * C];
        match to - from {
            1 => spend_block::<S, C, 1>(simd, terms, weight, k, from, sums),
            2 => spend_block::<S, C, 2>(simd, terms, weight, k, from, sums),
            3 => spend_block::<S, C, 3>(simd, terms, weight, k, from, sums),
            _ => spend_block::<S, C, 4>(simd, terms, weight, k, from, sums),
        }
        from = to;
    }
}

#[inline(always)]
fn spend_block<S: Simd, const C: usize, const K: usize>(
    simd: S,
    terms: &[[S::f64s; C]],
    weight: &[f64],
    k: usize,
    from: usize,
    sums: &mut [S::f64s],
) {
    let mut local = [[simd.splat_f64s(0.0); C]; K];
    for (term, weight) in terms.iter().zip(weight.chunks_exact(k)) {
        let weight: &[f64; K] = weight[from..from + K].try_into().unwrap();
        for n in 0..K {
            let w = simd.splat_f64s(weight[n]);
            for c in 0..C {
                local[n][c] = simd.mul_add_e_f64s(w, term[c], local[n][c]);
            }
        }
    }
    for n in 0..K {
        for c in 0..C {
            sums[n * C + c] = simd.add_f64s(sums[n * C + c], local[n][c]);
        }
    }
}

/// `out[i][k] += Σ_j (term_i(s_j) · d_j) a[j][k]` over sources `j`, for every term `i`.
pub(super) fn forward(
    terms: impl Terms<3>,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    assert_eq!(d.len(), sources.len(), "one displacement per source");
    assert_eq!(a.len(), sources.len() * columns, "a: [source][k]");
    assert_eq!(out.len(), terms.len() * columns, "out: [target][k]");
    if out.is_empty() || sources.is_empty() {
        return;
    }
    let d = Sources::new(d);
    let by_column = by_column(a, columns, sources);
    let pairs = terms.len() * sources.len();
    PAIRS.add(pairs);
    parts(out, TILE * columns, pairs, |tile, out| {
        dispatch(Forward {
            terms,
            sources,
            d: &d,
            a: &by_column,
            columns,
            tile,
            out,
        });
    });
}

/// Columns of `a` apart, with zeros for the padding of the sources.
pub(super) fn by_column(a: &[f64], columns: usize, sources: &Sources) -> Vec<f64> {
    let padded = sources.x.len();
    let mut out = vec![0.0; columns * padded];
    for (j, a) in a.chunks_exact(columns).enumerate() {
        for (k, a) in a.iter().enumerate() {
            out[k * padded + j] = *a;
        }
    }
    out
}

struct Forward<'a, T> {
    terms: T,
    sources: &'a Sources,
    d: &'a Sources,
    a: &'a [f64],
    columns: usize,
    tile: usize,
    out: &'a mut [f64],
}

impl<T: Terms<3>> WithSimd for Forward<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let k = self.columns;
        let zero = simd.splat_f64s(0.0);
        let count = self.out.len() / k;
        let vectors = self.sources.x.len() / S::F64_LANES;
        let a = S::as_simd_f64s(self.a).0;
        // Lanes are added up only at the end.
        let mut sums = vec![zero; count * k];
        let mut scratch = Aligned([[zero; 2 * TILE]; 2]);
        let mut buffer = Aligned([[zero; 3]; TILE]);
        let mut slopes = Aligned([[zero; TILE]; GROUP]);
        let mut first = 0;
        while first < vectors {
            let group = GROUP.min(vectors - first);
            for (v, slopes) in slopes.0[..group].iter_mut().enumerate() {
                let s = load(simd, self.sources, first + v);
                let d = load(simd, self.d, first + v);
                self.terms
                    .evaluate(simd, self.tile, s, d, &mut scratch.0, &mut buffer.0);
                for (slope, g) in slopes.iter_mut().zip(&buffer.0[..count]) {
                    let g = [
                        Lanes::new(simd, g[0]),
                        Lanes::new(simd, g[1]),
                        Lanes::new(simd, g[2]),
                    ];
                    *slope = dot(g, d).v;
                }
            }
            for n in 0..k {
                let a = &a[n * vectors + first..][..group];
                // The full group unrolled; the rest one by one.
                if let &[a0, a1] = a {
                    for i in 0..count {
                        let sum = &mut sums[i * k + n];
                        *sum = simd.mul_add_e_f64s(slopes.0[0][i], a0, *sum);
                        *sum = simd.mul_add_e_f64s(slopes.0[1][i], a1, *sum);
                    }
                } else {
                    for i in 0..count {
                        let sum = &mut sums[i * k + n];
                        *sum = simd.mul_add_e_f64s(slopes.0[0][i], a[0], *sum);
                    }
                }
            }
            first += group;
        }
        for (out, sum) in self.out.iter_mut().zip(&sums) {
            *out += simd.reduce_sum_f64s(*sum);
        }
    }
}

/// Writes a vector of entries, cut to the length of `out`.
#[inline(always)]
pub(super) fn put<S: Simd>(simd: S, add: bool, value: S::f64s, out: &mut [f64]) {
    if out.len() == S::F64_LANES {
        let out = &mut S::as_mut_simd_f64s(out).0[0];
        *out = if add {
            simd.add_f64s(*out, value)
        } else {
            value
        };
    } else {
        let value = if add {
            simd.add_f64s(simd.partial_load_f64s(out), value)
        } else {
            value
        };
        simd.partial_store_f64s(out, value);
    }
}

/// Checks the shape of a block to fill and gives its rows, a tile at a time, to `task`.
pub(super) fn fill(
    targets: usize,
    sources: &Sources,
    out: &mut [f64],
    stride: usize,
    column: usize,
    tile: usize,
    task: impl Fn(usize, &mut [f64]) + Sync,
) {
    if targets == 0 || sources.is_empty() {
        return;
    }
    assert!(
        column + sources.len() <= stride,
        "the block ends at the row's end"
    );
    assert!(
        out.len() >= (targets - 1) * stride + column + sources.len(),
        "rows missing"
    );
    let end = out.len().min(targets * stride);
    let pairs = targets * sources.len();
    PAIRS.add(pairs);
    parts(&mut out[..end], tile * stride, pairs, task);
}

/// A constant in every lane.
#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, v: &Vec3) -> V3<Lanes<S>> {
    [
        Lanes::splat(simd, v.x),
        Lanes::splat(simd, v.y),
        Lanes::splat(simd, v.z),
    ]
}

/// The registers of a gradient.
#[inline(always)]
pub(super) fn registers<S: Simd>(g: V3<Lanes<S>>) -> [S::f64s; 3] {
    [g[0].v, g[1].v, g[2].v]
}

/// Length of a vector.
#[inline(always)]
pub(super) fn length<T: Lane>(r: V3<T>) -> T {
    dot(r, r).sqrt()
}
