//! Products with the few columns of a body's matrices.

use crate::adjoint::multipole::{self, Number};
use crate::solver::dot;
use nalgebra::DMatrix;

/// A x.
pub(super) fn combined<T: Number>(a: &DMatrix<f64>, x: &[T]) -> Vec<T> {
    let mut out = vec![T::constant(0.0); a.nrows()];
    multipole::vectorized(
        #[inline(always)]
        || {
            for (x, column) in x.iter().zip(a.as_slice().chunks_exact(out.len())) {
                for (out, a) in out.iter_mut().zip(column) {
                    *out += *x * *a;
                }
            }
        },
    );
    out
}

/// Its transpose, Aᵀ x.
pub(super) fn products(a: &DMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let columns = a.as_slice().chunks_exact(x.len());
    multipole::vectorized(
        #[inline(always)]
        || columns.map(|column| dot(column, x)).collect(),
    )
}

/// The same of any numbers.
pub(super) fn products_of<T: Number>(a: &DMatrix<f64>, x: &[T]) -> Vec<T> {
    let columns = a.as_slice().chunks_exact(x.len());
    multipole::vectorized(
        #[inline(always)]
        || {
            let one = |column: &[f64]| {
                let each = x.iter().zip(column);
                each.fold(T::constant(0.0), |sum, (x, a)| sum + *x * *a)
            };
            columns.map(one).collect()
        },
    )
}
