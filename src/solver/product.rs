//! Products of a dense row-major matrix with a few columns, parallel over fixed groups of rows.
//!
//! With few columns a general matrix product spends its time packing the large factor; here tiles of rows are
//! used twice, for `K x` and for `Kᵀ y`, while they are in cache.

use super::{CALLS, Columns};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Rows of a tile: a few thousand columns of it stay in the second-level cache.
const TILE: usize = 16;
/// Rows whose dot products are taken together.
const QUAD: usize = 4;
/// Most columns in registers at once.
const MOST: usize = 6;
/// Vectors of Kᵀ y that share what they load of y.
const PAIR: usize = 2;
/// Partial results that are added one by one; fixes the order of the sum.
const GROUPS: usize = 8;

/// One group of rows: `middle = K x` (or given), `out += Kᵀ middle`.
struct Tiles<'a> {
    /// Rows of K in this group.
    k: &'a [f64],
    stride: usize,
    columns: usize,
    /// x, column by column; empty if `middle` is given.
    x: &'a [f64],
    /// `[row][column]`.
    middle: &'a mut [f64],
    /// Kᵀ middle, column by column; empty if it isn't wanted.
    out: &'a mut [f64],
}

impl WithSimd for Tiles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            k,
            stride,
            columns,
            x,
            middle,
            out,
        } = self;
        let groups = columns.div_ceil(MOST);
        let width = columns.div_ceil(groups);
        for (rows, middle) in k
            .chunks(TILE * stride)
            .zip(middle.chunks_mut(TILE * columns))
        {
            for first in (0..columns).step_by(width) {
                let count = width.min(columns - first);
                macro_rules! group {
                    ($($n:literal)*) => {
                        match count {
                            $($n => {
                                if !x.is_empty() {
                                    let x: [&[f64]; $n] =
                                        std::array::from_fn(|c| &x[(first + c) * stride..][..stride]);
                                    dots::<S, $n>(simd, rows, stride, &x, middle, columns, first);
                                }
                                if !out.is_empty() {
                                    let part = &mut out[first * stride..(first + $n) * stride];
                                    updates::<S, $n>(simd, rows, stride, middle, columns, first, part);
                                }
                            })*
                            _ => unreachable!("at most MOST columns"),
                        }
                    };
                }
                group!(1 2 3 4 5 6);
            }
        }
    }
}

/// `middle[row][first + c] = rows[row] · x[c]`.
#[inline(always)]
fn dots<S: Simd, const N: usize>(
    simd: S,
    rows: &[f64],
    stride: usize,
    x: &[&[f64]; N],
    middle: &mut [f64],
    columns: usize,
    first: usize,
) {
    let heads: [&[S::f64s]; N] = std::array::from_fn(|c| S::as_simd_f64s(x[c]).0);
    let tails: [&[f64]; N] = std::array::from_fn(|c| S::as_simd_f64s(x[c]).1);
    let count = rows.len() / stride;
    for from in (0..count).step_by(QUAD) {
        // A short last quad repeats its last row; the repeats aren't written.
        let row = |r: usize| &rows[(from + r).min(count - 1) * stride..][..stride];
        let head: [&[S::f64s]; QUAD] = std::array::from_fn(|r| S::as_simd_f64s(row(r)).0);
        let tail: [&[f64]; QUAD] = std::array::from_fn(|r| S::as_simd_f64s(row(r)).1);
        let lanes = heads[0].len();
        let mut sum = [[simd.splat_f64s(0.0); N]; QUAD];
        for j in 0..lanes {
            let k: [S::f64s; QUAD] = std::array::from_fn(|r| head[r][j]);
            for c in 0..N {
                let x = heads[c][j];
                for r in 0..QUAD {
                    sum[r][c] = simd.mul_add_e_f64s(k[r], x, sum[r][c]);
                }
            }
        }
        for r in 0..QUAD.min(count - from) {
            for c in 0..N {
                let mut total = simd.reduce_sum_f64s(sum[r][c]);
                for (k, x) in tail[r].iter().zip(tails[c]) {
                    total += k * x;
                }
                middle[(from + r) * columns + first + c] = total;
            }
        }
    }
}

/// `out[c] += Σ_row middle[row][first + c] rows[row]`.
#[inline(always)]
fn updates<S: Simd, const N: usize>(
    simd: S,
    rows: &[f64],
    stride: usize,
    middle: &[f64],
    columns: usize,
    first: usize,
    out: &mut [f64],
) {
    let count = rows.len() / stride;
    let out: [&mut [f64]; N] = {
        let mut parts = out.chunks_exact_mut(stride);
        std::array::from_fn(|_| parts.next().unwrap_or_default())
    };
    let (whole, rest) = S::as_simd_f64s(&rows[..stride]);
    let vectors = whole.len();
    let lanes = (stride - rest.len()).checked_div(vectors).unwrap_or(1);
    macro_rules! add {
        ($from:expr, $vectors:expr) => {
            let at = $from * lanes;
            let size = $vectors * lanes;
            let mut sum = [[simd.splat_f64s(0.0); $vectors]; N];
            for c in 0..N {
                let out = S::as_simd_f64s(&out[c][at..at + size]).0;
                for v in 0..$vectors {
                    sum[c][v] = out[v];
                }
            }
            for r in 0..count {
                let k = S::as_simd_f64s(&rows[r * stride + at..r * stride + at + size]).0;
                for c in 0..N {
                    let m = simd.splat_f64s(middle[r * columns + first + c]);
                    for v in 0..$vectors {
                        sum[c][v] = simd.mul_add_e_f64s(k[v], m, sum[c][v]);
                    }
                }
            }
            for c in 0..N {
                let out = S::as_mut_simd_f64s(&mut out[c][at..at + size]).0;
                for v in 0..$vectors {
                    out[v] = sum[c][v];
                }
            }
        };
    }
    let pairs = vectors / PAIR * PAIR;
    for j in (0..pairs).step_by(PAIR) {
        add!(j, PAIR);
    }
    for j in pairs..vectors {
        add!(j, 1);
    }
    for j in vectors * lanes..stride {
        for r in 0..count {
            for c in 0..N {
                out[c][j] += middle[r * columns + first + c] * rows[r * stride + j];
            }
        }
    }
}

/// Column-major copy.
fn by_columns(x: &Columns) -> Vec<f64> {
    (0..x.columns).flat_map(|c| x.column(c)).collect()
}

/// Rows of each group: a multiple of the tile.
fn group_rows(rows: usize) -> usize {
    rows.div_ceil(GROUPS).next_multiple_of(TILE).max(TILE)
}

/// `K x`, K row-major rows × x.rows.
pub fn product(k: &[f64], rows: usize, x: &Columns) -> Columns {
    CALLS.add(1);
    let n = x.columns;
    let mut out = Columns::zeros(rows, n);
    if n == 0 || rows == 0 || x.rows == 0 {
        return out;
    }
    let columns = by_columns(x);
    let size = group_rows(rows);
    k.par_chunks(size * x.rows)
        .zip(out.data.par_chunks_mut(size * n))
        .for_each(|(k, middle)| {
            Arch::new().dispatch(Tiles {
                k,
                stride: x.rows,
                columns: n,
                x: &columns,
                middle,
                out: &mut [],
            });
        });
    out
}

/// `Σ Kᵀ middle` over groups of rows of K (rows × stride), `middle` of each from its number and rows;
/// made of K x first where x is given by columns.
fn transposed(
    k: &[f64],
    [rows, stride, n]: [usize; 3],
    x: &[f64],
    middle: impl Fn(usize, usize) -> Vec<f64> + Sync,
) -> Columns {
    CALLS.add(1);
    if n == 0 || rows == 0 || stride == 0 {
        return Columns::zeros(stride, n);
    }
    let size = group_rows(rows);
    let parts: Vec<Vec<f64>> = k
        .par_chunks(size * stride)
        .enumerate()
        .map(|(group, k)| {
            let mut out = vec![0.0; stride * n];
            Arch::new().dispatch(Tiles {
                k,
                stride,
                columns: n,
                x,
                middle: &mut middle(group * size, k.len() / stride),
                out: &mut out,
            });
            out
        })
        .collect();
    // Column by column, the groups in their order.
    Columns::from_fn(stride, n, |i, c| {
        parts.iter().map(|p| p[c * stride + i]).sum()
    })
}

/// `Kᵀ y`, K row-major y.rows × columns.
pub fn transposed_product(k: &[f64], columns: usize, y: &Columns) -> Columns {
    transposed(k, [y.rows, columns, y.columns], &[], |from, rows| {
        y.slice(&(from..from + rows)).to_vec()
    })
}

/// `Kᵀ (K x)` with K read once, K row-major rows × x.rows.
pub fn normal_product(k: &[f64], rows: usize, x: &Columns) -> Columns {
    transposed(k, [rows, x.rows, x.columns], &by_columns(x), |_, rows| {
        vec![0.0; rows * x.columns]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(rows: usize, columns: usize, phase: f64) -> Columns {
        Columns::from_fn(rows, columns, |i, k| {
            (1.3 * i as f64 + 0.7 * k as f64 + phase).sin()
        })
    }

    #[test]
    fn products_agree_with_plain_sums_for_all_shapes() {
        for (rows, columns) in [(1, 1), (3, 7), (17, 9), (130, 41), (300, 64)] {
            let k = filled(rows, columns, 0.3);
            for n in [1, 2, 5, 6, 7, 10, 13] {
                let (x, y) = (filled(columns, n, 0.1), filled(rows, n, 0.9));
                let kx = Columns::from_fn(rows, n, |i, c| {
                    (0..columns).map(|j| k.at(i, j) * x.at(j, c)).sum()
                });
                let transposed = |y: &Columns| {
                    Columns::from_fn(columns, n, |j, c| {
                        (0..rows).map(|i| k.at(i, j) * y.at(i, c)).sum()
                    })
                };
                let close = |a: &Columns, b: &Columns| {
                    let scale = b.data.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
                    let pairs = a.data.iter().zip(&b.data);
                    assert_eq!((a.rows, a.columns), (b.rows, b.columns));
                    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-13 * scale);
                };
                close(&product(&k.data, rows, &x), &kx);
                close(&transposed_product(&k.data, columns, &y), &transposed(&y));
                close(&normal_product(&k.data, rows, &x), &transposed(&kx));
            }
        }
    }
}
