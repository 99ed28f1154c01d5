//! Products of a dense row-major matrix with a few columns, parallel over fixed groups of rows.
//!
//! With few columns a general matrix product spends its time packing the large factor; here tiles of rows are
//! used twice, for `K x` and for `Kᵀ y`, while they are in cache.

use super::{CALLS, Columns};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

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

/// One group of rows: `made = K x`, `out += Kᵀ y`.
struct Tiles<'a> {
    /// Rows of K in this group.
    k: &'a [f64],
    stride: usize,
    /// x, column by column; empty if K x isn't wanted.
    x: &'a [f64],
    /// `[row][column]`.
    made: &'a mut [f64],
    /// y, `[row][column]`; none for K x.
    y: Option<&'a [f64]>,
    /// Kᵀ y, column by column; empty if it isn't wanted.
    out: &'a mut [f64],
}

impl WithSimd for Tiles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            k,
            stride,
            x,
            made,
            y,
            out,
        } = self;
        let (n, m) = (x.len() / stride, out.len() / stride);
        macro_rules! of_count {
            ($count:expr, $task:ident($($argument:expr),*)) => {
                match $count {
                    1 => $task::<S, 1>($($argument),*),
                    2 => $task::<S, 2>($($argument),*),
                    3 => $task::<S, 3>($($argument),*),
                    4 => $task::<S, 4>($($argument),*),
                    5 => $task::<S, 5>($($argument),*),
                    6 => $task::<S, 6>($($argument),*),
                    _ => unreachable!("at most MOST columns"),
                }
            };
        }
        for (tile, rows) in k.chunks(TILE * stride).enumerate() {
            let (from, count) = (tile * TILE, rows.len() / stride);
            let made = &mut made[from * n..(from + count) * n];
            for at in column_groups(n) {
                let x = &x[at.start * stride..at.end * stride];
                of_count!(at.len(), dots(simd, rows, stride, x, made, n, at.start));
            }
            let y = match y {
                Some(y) => &y[from * m..(from + count) * m],
                None => made,
            };
            for at in column_groups(m) {
                let out = &mut out[at.start * stride..at.end * stride];
                of_count!(at.len(), updates(simd, rows, stride, y, m, at.start, out));
            }
        }
    }
}

/// Even groups of at most [`MOST`] columns.
#[inline(always)]
fn column_groups(columns: usize) -> impl Iterator<Item = Range<usize>> {
    let width = columns.div_ceil(columns.div_ceil(MOST).max(1)).max(1);
    let group = move |first| first..columns.min(first + width);
    (0..columns).step_by(width).map(group)
}

/// `middle[row][first + c] = rows[row] · x[c]`.
#[inline(always)]
fn dots<S: Simd, const N: usize>(
    simd: S,
    rows: &[f64],
    stride: usize,
    x: &[f64],
    middle: &mut [f64],
    columns: usize,
    first: usize,
) {
    let x: [&[f64]; N] = std::array::from_fn(|c| &x[c * stride..][..stride]);
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
    let [made, _] = both_products(k, rows, x, &Columns::zeros(rows, 0));
    made
}

/// `Kᵀ y`, K row-major y.rows × columns.
pub fn transposed_product(k: &[f64], columns: usize, y: &Columns) -> Columns {
    let [_, out] = both_products(k, y.rows, &Columns::zeros(columns, 0), y);
    out
}

/// `K x` and `Kᵀ y` with K read once, K row-major rows × x.rows.
pub fn both_products(k: &[f64], rows: usize, x: &Columns, y: &Columns) -> [Columns; 2] {
    products(k, rows, x, Some(y))
}

/// `Kᵀ (K x)` with K read once, K row-major rows × x.rows.
pub fn normal_product(k: &[f64], rows: usize, x: &Columns) -> Columns {
    let [_, out] = products(k, rows, x, None);
    out
}

/// `K x` and `Kᵀ y`, y = K x where none is given.
fn products(k: &[f64], rows: usize, x: &Columns, y: Option<&Columns>) -> [Columns; 2] {
    CALLS.add(1);
    let (stride, n, m) = (x.rows, x.columns, y.unwrap_or(x).columns);
    let mut made = Columns::zeros(rows, n);
    if rows == 0 || stride == 0 || n + m == 0 {
        return [made, Columns::zeros(stride, m)];
    }
    let columns = by_columns(x);
    let size = group_rows(rows);
    let mut rest = &mut made.data[..];
    let mut tasks = Vec::with_capacity(GROUPS);
    for (group, k) in k.chunks(size * stride).enumerate() {
        let at = group * size..group * size + k.len() / stride;
        let (made, other) = rest.split_at_mut(at.len() * n);
        rest = other;
        tasks.push((k, made, y.map(|y| y.slice(&at))));
    }
    let sums = tasks.into_par_iter().map(|(k, made, y)| {
        let mut out = vec![0.0; stride * m];
        Arch::new().dispatch(Tiles {
            k,
            stride,
            x: &columns,
            made,
            y,
            out: &mut out,
        });
        out
    });
    let parts: Vec<Vec<f64>> = sums.collect();
    // Column by column, the groups in their order.
    let sum = |i: usize, c: usize| parts.iter().map(|p| p[c * stride + i]).sum();
    let out = Columns::from_fn(stride, m, sum);
    [made, out]
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
                // The same bits in one sweep, with any number of columns of either.
                for other in [0, 1, 4, 8] {
                    let y = filled(rows, other, 0.9);
                    let [made, out] = both_products(&k.data, rows, &x, &y);
                    assert_eq!(made, product(&k.data, rows, &x));
                    assert_eq!(out, transposed_product(&k.data, columns, &y));
                }
            }
        }
    }
}
