//! Dense LU with partial pivoting, in the memory of the matrix, parallel over fixed groups of columns.

use super::{CALLS, condition, largest_eigenvalue, matmul, product, transposed_product};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::perm::PermRef;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Columns factored at once, and columns of one task: the same whatever the number of threads.
const BLOCK: usize = 192;

/// Factored square matrix.
#[derive(Clone, Debug)]
pub struct Lu {
    /// L below the diagonal, U on and above it, column-major.
    data: Vec<f64>,
    size: usize,
    permutation: Vec<usize>,
    inverse: Vec<usize>,
    condition: f64,
}

impl Lu {
    /// Factors the `size` × `size` matrix in `data` (column-major), which it takes over. A singular
    /// matrix has the condition number infinity and no use.
    pub fn new(mut data: Vec<f64>, size: usize) -> Self {
        CALLS.add(1);
        assert_eq!(data.len(), size * size, "a square matrix");
        // The memory of A by columns is that of Aᵀ by rows.
        let largest = largest_eigenvalue(size, |x| {
            product(&data, size, &transposed_product(&data, size, x))
        });
        let permutation = factor(&mut data, size);
        let mut inverse = vec![0; size];
        for (to, from) in permutation.iter().enumerate() {
            inverse[*from] = to;
        }
        let mut out = Self {
            data,
            size,
            permutation,
            inverse,
            condition: f64::INFINITY,
        };
        let reciprocal = largest_eigenvalue(size, |x| {
            let mut y = x.clone();
            out.solve_transpose(y.as_mat_mut());
            out.solve(y.as_mat_mut());
            y
        });
        out.condition = condition(largest, reciprocal);
        out
    }

    /// Ratio of the largest singular value to the smallest, estimated from below by a few steps of
    /// Lanczos on AᵀA and on its inverse.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    fn factors(&self) -> (MatRef<'_, f64>, PermRef<'_, usize>) {
        (
            MatRef::from_column_major_slice(&self.data, self.size, self.size),
            PermRef::new_checked(&self.permutation, &self.inverse, self.size),
        )
    }

    /// `x ← A⁻¹ x`, x size × columns.
    pub fn solve(&self, x: MatMut<'_, f64>) {
        CALLS.add(1);
        let (lu, rows) = self.factors();
        let scratch = solve::solve_in_place_scratch::<usize, f64>(self.size, x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        solve::solve_in_place(lu, lu, rows, x, Par::Seq, stack);
    }

    /// A⁻¹, column-major.
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.size;
        let mut out = vec![0.0; n * n];
        let groups = out.par_chunks_mut((BLOCK * n).max(1)).enumerate();
        groups.for_each(|(group, columns)| {
            for (k, column) in columns.chunks_exact_mut(n).enumerate() {
                column[group * BLOCK + k] = 1.0;
            }
            let count = columns.len() / n;
            self.solve(MatMut::from_column_major_slice_mut(columns, n, count));
        });
        out
    }

    /// `x ← A⁻ᵀ x`.
    pub fn solve_transpose(&self, x: MatMut<'_, f64>) {
        CALLS.add(1);
        let (lu, rows) = self.factors();
        let scratch =
            solve::solve_transpose_in_place_scratch::<usize, f64>(self.size, x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        solve::solve_transpose_in_place(lu, lu, rows, x, Par::Seq, stack);
    }
}

/// Factors by blocks of columns; returns which row of the matrix each row of the factors was.
fn factor(data: &mut [f64], n: usize) -> Vec<usize> {
    let mut permutation: Vec<usize> = (0..n).collect();
    let (mut forward, mut backward) = (vec![0usize; n], vec![0usize; n]);
    for k in (0..n).step_by(BLOCK) {
        let (width, rows) = (BLOCK.min(n - k), n - k);
        let (left, rest) = data.split_at_mut(k * n);
        let (block, right) = rest.split_at_mut(width * n);
        let view = MatMut::from_column_major_slice_mut(block, n, width);
        let scratch =
            factor::lu_in_place_scratch::<usize, f64>(rows, width, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        factor::lu_in_place(
            view.subrows_mut(k, rows),
            &mut forward[..rows],
            &mut backward[..rows],
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        // Few rows change places: (to, from).
        let moved: Vec<(usize, usize)> = (0..rows)
            .filter(|i| forward[*i] != *i)
            .map(|i| (k + i, k + forward[i]))
            .collect();
        let before: Vec<usize> = moved.iter().map(|(_, from)| permutation[*from]).collect();
        for ((to, _), row) in moved.iter().zip(before) {
            permutation[*to] = row;
        }
        let exchange = |columns: &mut [f64]| {
            let mut before = Vec::with_capacity(moved.len());
            for column in columns.chunks_exact_mut(n) {
                before.clear();
                before.extend(moved.iter().map(|(_, from)| column[*from]));
                for ((to, _), x) in moved.iter().zip(&before) {
                    column[*to] = *x;
                }
            }
        };
        left.par_chunks_mut(BLOCK * n).for_each(exchange);
        let block = MatRef::from_column_major_slice(block, n, width).subrows(k, rows);
        let (corner, below) = block.split_at_row(width);
        right.par_chunks_mut(BLOCK * n).for_each(|columns| {
            exchange(columns);
            let count = columns.len() / n;
            let columns = MatMut::from_column_major_slice_mut(columns, n, count);
            let (mut top, bottom) = columns.subrows_mut(k, rows).split_at_row_mut(width);
            solve_unit_lower_triangular_in_place(corner, top.as_mut(), Par::Seq);
            matmul(bottom, Accum::Add, below, top.as_ref(), -1.0);
        });
    }
    permutation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::Columns;

    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let noise = (0.4 + 3.1 * i as f64 + 1.7 * (j * j) as f64).sin();
            // Small on the diagonal, so that rows change places.
            noise * if i == j { 0.01 } else { 1.0 }
        };
        (0..n * n).map(|k| entry(k % n, k / n)).collect()
    }

    #[test]
    fn solves_the_matrix_and_its_transpose() {
        for n in [1, 2, 7, 40, 192, 450] {
            let a = matrix(n);
            let lu = Lu::new(a.clone(), n);
            let x = Columns::from_fn(n, 3, |i, k| (0.7 * i as f64 + k as f64).cos());
            let mut y = transposed_product(&a, n, &x);
            lu.solve(y.as_mat_mut());
            let mut z = product(&a, n, &x);
            lu.solve_transpose(z.as_mat_mut());
            for (i, x) in x.data.iter().enumerate() {
                assert!((y.data[i] - x).abs() < 1e-13 * lu.condition(), "{n}");
                assert!((z.data[i] - x).abs() < 1e-13 * lu.condition(), "{n}");
            }
            // By rows these are those of the transposes.
            let identity = product(
                &lu.inverse(),
                n,
                &Columns::from_fn(n, n, |i, j| a[i * n + j]),
            );
            for (i, x) in identity.data.iter().enumerate() {
                let one = f64::from(i / n == i % n);
                assert!((x - one).abs() < 1e-13 * lu.condition(), "{n}");
            }
        }
    }

    #[test]
    fn condition_of_a_diagonal_matrix() {
        let n = 20;
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            a[i * n + i] = if i == 3 { 50.0 } else { 1.0 };
        }
        let condition = Lu::new(a.clone(), n).condition();
        assert!((condition - 50.0).abs() < 1e-6, "{condition}");
        a[4 * n + 4] = 0.0;
        assert_eq!(Lu::new(a, n).condition(), f64::INFINITY);
    }
}
