//! Matrices and interleaved columns as the kernels see them.

use faer::{Mat, MatMut, MatRef};
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// 4π: a source of strength α makes the flux 4πα.
pub(in crate::coupling) const FLUX: f64 = 4.0 * PI;

/// A nalgebra matrix as faer sees it.
pub(super) fn view(m: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

pub(super) fn view_mut(m: &mut DMatrix<f64>) -> MatMut<'_, f64> {
    let (r, c) = m.shape();
    MatMut::from_column_major_slice_mut(m.as_mut_slice(), r, c)
}

/// A faer matrix as nalgebra sees it.
pub(super) fn dense(m: &Mat<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

/// Columns `k` and `k'` of two vectors beside each other, `[row][column]`.
pub(super) fn interleave(columns: &[&[f64]]) -> Vec<f64> {
    let rows = columns.first().map_or(0, |c| c.len());
    (0..rows)
        .flat_map(|i| columns.iter().map(move |c| c[i]))
        .collect()
}
