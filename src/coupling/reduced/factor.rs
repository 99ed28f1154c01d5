//! Cholesky factorisation of the coupled system, in its own memory.

use super::views::{view, view_mut};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Conj, Par, Spec};
use nalgebra::DMatrix;

/// Lower factor of a symmetric positive definite matrix; above the diagonal stands what stood there.
pub(super) struct Factor(DMatrix<f64>);

impl Factor {
    /// From the lower triangle, which is overwritten; `None` where it isn't positive definite.
    pub fn new(mut lower: DMatrix<f64>) -> Option<Self> {
        let (n, par) = (lower.nrows(), Par::Seq);
        let params: Spec<llt::factor::LltParams, f64> = Spec::default();
        let need = llt::factor::cholesky_in_place_scratch::<f64>(n, par, params);
        let mut buffer = MemBuffer::new(need);
        let stack = MemStack::new(&mut buffer);
        let none = llt::factor::LltRegularization::default();
        llt::factor::cholesky_in_place(view_mut(&mut lower), none, par, stack, params).ok()?;
        Some(Self(lower))
    }

    /// Solves for all columns, which are overwritten.
    pub fn solve_in_place(&self, columns: &mut DMatrix<f64>) {
        let (l, right) = (view(&self.0), view_mut(columns));
        let mut buffer = MemBuffer::new(llt::solve::solve_in_place_scratch::<f64>(
            l.nrows(),
            right.ncols(),
            Par::Seq,
        ));
        let stack = MemStack::new(&mut buffer);
        llt::solve::solve_in_place_with_conj(l, Conj::No, right, Par::Seq, stack);
    }

    /// (largest / smallest pivot)²: the condition number, from below.
    pub fn condition(&self) -> f64 {
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for i in 0..self.0.nrows() {
            low = low.min(self.0[(i, i)]);
            high = high.max(self.0[(i, i)]);
        }
        if high > 0.0 {
            (high / low).powi(2)
        } else {
            1.0
        }
    }
}
