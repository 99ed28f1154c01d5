//! Dense LU with partial pivoting, in the memory of the matrix.

use super::{Columns, product, transposed_product};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::{MatMut, MatRef, Par};

/// Steps of the power iterations behind [`Lu::condition`].
const STEPS: usize = 12;

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
        assert_eq!(data.len(), size * size, "a square matrix");
        let start = Columns::from_fn(size, 1, |i, _| (1.0 + 7.0 * i as f64).sin() + 0.3);
        let mut x = start.clone();
        let mut largest = 0.0;
        for _ in 0..STEPS {
            normalise(&mut x);
            // The memory of A by columns is that of Aᵀ by rows.
            x = product(&data, size, &transposed_product(&data, size, &x));
            largest = length(&x).sqrt();
        }
        let (mut permutation, mut inverse) = (vec![0usize; size], vec![0usize; size]);
        let par = Par::Seq;
        let scratch =
            factor::lu_in_place_scratch::<usize, f64>(size, size, par, Default::default());
        let mut memory = MemBuffer::new(scratch);
        factor::lu_in_place(
            MatMut::from_column_major_slice_mut(&mut data, size, size),
            &mut permutation,
            &mut inverse,
            par,
            MemStack::new(&mut memory),
            Default::default(),
        );
        let mut out = Self {
            data,
            size,
            permutation,
            inverse,
            condition: f64::INFINITY,
        };
        let mut y = start;
        let mut reciprocal = 0.0;
        for _ in 0..STEPS {
            normalise(&mut y);
            out.solve_transpose(y.as_mat_mut());
            out.solve(y.as_mat_mut());
            reciprocal = length(&y).sqrt();
        }
        let condition = largest * reciprocal;
        if condition.is_finite() {
            out.condition = condition;
        }
        out
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Ratio of the largest singular value to the smallest, estimated from below by a few steps of
    /// power and inverse iteration.
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
        let (lu, rows) = self.factors();
        let scratch = solve::solve_in_place_scratch::<usize, f64>(self.size, x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        solve::solve_in_place(lu, lu, rows, x, Par::Seq, stack);
    }

    /// `x ← A⁻ᵀ x`.
    pub fn solve_transpose(&self, x: MatMut<'_, f64>) {
        let (lu, rows) = self.factors();
        let scratch =
            solve::solve_transpose_in_place_scratch::<usize, f64>(self.size, x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        solve::solve_transpose_in_place(lu, lu, rows, x, Par::Seq, stack);
    }
}

fn length(x: &Columns) -> f64 {
    x.dots(x)[0].sqrt()
}

fn normalise(x: &mut Columns) {
    let length = length(x);
    x.data.iter_mut().for_each(|v| *v /= length);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let noise = (3.1 * i as f64 + 1.7 * (j * j) as f64).sin();
            noise + if i == j { 4.0 } else { 0.0 }
        };
        (0..n * n).map(|k| entry(k % n, k / n)).collect()
    }

    #[test]
    fn solves_the_matrix_and_its_transpose() {
        for n in [1, 2, 7, 40, 130] {
            let a = matrix(n);
            let lu = Lu::new(a.clone(), n);
            let x = Columns::from_fn(n, 3, |i, k| (0.7 * i as f64 + k as f64).cos());
            let mut y = transposed_product(&a, n, &x);
            lu.solve(y.as_mat_mut());
            let mut z = product(&a, n, &x);
            lu.solve_transpose(z.as_mat_mut());
            for (i, x) in x.data.iter().enumerate() {
                assert!((y.data[i] - x).abs() < 1e-12 * lu.condition(), "{n}");
                assert!((z.data[i] - x).abs() < 1e-12 * lu.condition(), "{n}");
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
