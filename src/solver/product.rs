//! Products with a dense row-major matrix, parallel over fixed chunks of rows.

use super::Columns;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Rows per chunk: a chunk of a few thousand columns stays in the second-level cache.
const CHUNK: usize = 64;
/// Partial results that are added one by one; fixes the order of the sum.
const GROUPS: usize = 8;

fn chunk(k: &[f64], columns: usize, from: usize, to: usize) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(&k[from * columns..to * columns], to - from, columns)
}

/// `K x`, K row-major rows × x.rows.
pub fn product(k: &[f64], rows: usize, x: &Columns) -> Columns {
    let n = x.columns;
    let mut out = Columns::zeros(rows, n);
    if n == 0 {
        return out;
    }
    out.data
        .par_chunks_mut(CHUNK * n)
        .enumerate()
        .for_each(|(c, part)| {
            let from = c * CHUNK;
            let to = (from + CHUNK).min(rows);
            let target = MatMut::from_row_major_slice_mut(part, to - from, n);
            let block = chunk(k, x.rows, from, to);
            matmul(target, Accum::Replace, block, x.as_mat(), 1.0, Par::Seq);
        });
    out
}

/// Sums `part(group)` over fixed groups of chunks in a fixed order.
fn grouped(
    rows: usize,
    size: (usize, usize),
    part: impl Fn(usize, usize, &mut Columns) + Sync,
) -> Columns {
    let chunks = rows.div_ceil(CHUNK);
    let per_group = chunks.div_ceil(GROUPS).max(1);
    let parts: Vec<Columns> = (0..GROUPS)
        .into_par_iter()
        .map(|g| {
            let mut out = Columns::zeros(size.0, size.1);
            for c in g * per_group..((g + 1) * per_group).min(chunks) {
                part(c * CHUNK, ((c + 1) * CHUNK).min(rows), &mut out);
            }
            out
        })
        .collect();
    let mut total = Columns::zeros(size.0, size.1);
    for p in &parts {
        for (t, x) in total.data.iter_mut().zip(&p.data) {
            *t += x;
        }
    }
    total
}

/// `Kᵀ y`, K row-major y.rows × columns.
pub fn transposed_product(k: &[f64], columns: usize, y: &Columns) -> Columns {
    if y.columns == 0 {
        return Columns::zeros(columns, 0);
    }
    grouped(y.rows, (columns, y.columns), |from, to, out| {
        let block = chunk(k, columns, from, to);
        let part = MatRef::from_row_major_slice(y.slice(from, to), to - from, y.columns);
        matmul(
            out.as_mat_mut(),
            Accum::Add,
            block.transpose(),
            part,
            1.0,
            Par::Seq,
        );
    })
}

/// `Kᵀ (K x)` with K read once, K row-major rows × x.rows.
pub fn normal_product(k: &[f64], rows: usize, x: &Columns) -> Columns {
    let n = x.columns;
    if n == 0 {
        return x.clone();
    }
    grouped(rows, (x.rows, n), |from, to, out| {
        let block = chunk(k, x.rows, from, to);
        let mut middle = vec![0.0; (to - from) * n];
        let target = MatMut::from_row_major_slice_mut(&mut middle, to - from, n);
        matmul(target, Accum::Replace, block, x.as_mat(), 1.0, Par::Seq);
        let middle = MatRef::from_row_major_slice(&middle, to - from, n);
        matmul(
            out.as_mat_mut(),
            Accum::Add,
            block.transpose(),
            middle,
            1.0,
            Par::Seq,
        );
    })
}
