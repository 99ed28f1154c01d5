//! Cholesky factors, in the matrix's own memory.

use super::CALLS;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, solve};
use faer::{Conj, MatMut, MatRef, Par, Spec};

/// Lower factor of a symmetric positive definite matrix. What stood above the diagonal still stands there: a copy of the
/// lower triangle alone would cost a tenth of a step with compressed bodies.
pub struct Cholesky {
    size: usize,
    /// By columns.
    data: Vec<f64>,
}

impl Cholesky {
    /// Factors a matrix of which the lower triangle is read; `None` where it isn't positive definite.
    pub fn new(mut data: Vec<f64>, size: usize) -> Option<Self> {
        CALLS.add(1);
        let params: Spec<factor::LltParams, f64> = Spec::default();
        let need = factor::cholesky_in_place_scratch::<f64>(size, Par::Seq, params);
        let mut memory = MemBuffer::new(need);
        let stack = MemStack::new(&mut memory);
        let matrix = MatMut::from_column_major_slice_mut(&mut data, size, size);
        let none = factor::LltRegularization::default();
        factor::cholesky_in_place(matrix, none, Par::Seq, stack, params).ok()?;
        Some(Self { size, data })
    }

    /// `x ← A⁻¹ x`, x size × columns.
    pub fn solve(&self, x: MatMut<'_, f64>) {
        CALLS.add(1);
        let lower = MatRef::from_column_major_slice(&self.data, self.size, self.size);
        let need = solve::solve_in_place_scratch::<f64>(self.size, x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(need);
        let stack = MemStack::new(&mut memory);
        solve::solve_in_place_with_conj(lower, Conj::No, x, Par::Seq, stack);
    }

    /// (largest / smallest pivot)²: the condition number, from below; 1 for an empty matrix.
    pub fn condition(&self) -> f64 {
        let pivots = self.data.iter().step_by(self.size + 1);
        let high = pivots.clone().fold(0.0, |a: f64, x| a.max(*x));
        let low = pivots.fold(f64::INFINITY, |a, x| a.min(*x));
        if high > 0.0 {
            (high / low).powi(2)
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};

    #[test]
    fn solves_and_refuses() {
        let a = dmatrix![4.0, 1.0, 0.5; 1.0, 3.0, 0.2; 0.5, 0.2, 9.0];
        let right = DMatrix::from_fn(3, 2, |i, j| (1 + i + 3 * j) as f64);
        let factor = Cholesky::new(a.as_slice().to_vec(), 3).expect("definite");
        let mut x = right.clone();
        factor.solve(MatMut::from_column_major_slice_mut(x.as_mut_slice(), 3, 2));
        assert!((a * x - right).amax() < 1e-14);
        assert!(factor.condition() > 2.0 && factor.condition() < 3.5);
        assert!(Cholesky::new(vec![1.0, 2.0, 2.0, 1.0], 2).is_none());
        assert_eq!(
            Cholesky::new(Vec::new(), 0).expect("empty").condition(),
            1.0
        );
    }
}
