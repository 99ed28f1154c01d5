//! A few columns side by side.

use crate::adjoint::multipole::vectorized;
use crate::adjoint::solve::Columnwise;
use faer::{MatMut, MatRef};
use std::ops::Range;

/// Lanes of a sum.
const LANES: usize = 8;

/// Row-major `[row][column]` array with few columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Entries, columns fastest.
    pub data: Vec<f64>,
}

impl Columns {
    /// All zero.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            data: vec![0.0; rows * columns],
        }
    }

    /// From a function of (row, column).
    pub fn from_fn(rows: usize, columns: usize, f: impl Fn(usize, usize) -> f64) -> Self {
        let at = (0..rows).flat_map(|i| (0..columns).map(move |k| (i, k)));
        Self {
            rows,
            columns,
            data: at.map(|(i, k)| f(i, k)).collect(),
        }
    }

    /// Entry.
    #[inline]
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.data[row * self.columns + column]
    }

    /// One row.
    #[inline]
    pub fn row(&self, row: usize) -> &[f64] {
        &self.data[row * self.columns..(row + 1) * self.columns]
    }

    /// As a matrix.
    pub fn as_mat(&self) -> MatRef<'_, f64> {
        MatRef::from_row_major_slice(&self.data, self.rows, self.columns)
    }

    /// As a matrix to be written.
    pub fn as_mat_mut(&mut self) -> MatMut<'_, f64> {
        MatMut::from_row_major_slice_mut(&mut self.data, self.rows, self.columns)
    }

    /// Some rows.
    pub fn slice(&self, rows: &Range<usize>) -> &[f64] {
        &self.data[rows.start * self.columns..rows.end * self.columns]
    }

    /// Some rows, to be written.
    pub fn slice_mut(&mut self, rows: &Range<usize>) -> &mut [f64] {
        &mut self.data[rows.start * self.columns..rows.end * self.columns]
    }

    /// Some rows on their own.
    pub fn part(&self, rows: &Range<usize>) -> Self {
        Self {
            rows: rows.len(),
            columns: self.columns,
            data: self.slice(rows).to_vec(),
        }
    }

    /// `self += other`.
    pub fn add(&mut self, other: &Self) {
        let pairs = self.data.iter_mut().zip(&other.data);
        pairs.for_each(|(a, b)| *a += b);
    }

    /// Combination of the columns.
    pub fn combine(&self, coefficients: &[f64]) -> Vec<f64> {
        debug_assert_eq!(coefficients.len(), self.columns);
        let products = |i| self.row(i).iter().zip(coefficients).map(|(a, b)| a * b);
        (0..self.rows).map(|i| products(i).sum()).collect()
    }

    /// One column.
    pub fn column(&self, k: usize) -> Vec<f64> {
        (0..self.rows).map(|i| self.at(i, k)).collect()
    }

    /// From columns of equal length.
    pub fn from_columns(columns: &[&[f64]]) -> Self {
        let rows = columns.first().map_or(0, |c| c.len());
        Self::from_fn(rows, columns.len(), |i, k| columns[k][i])
    }

    /// Dot products of equal columns of two arrays, each the same to the last bit whatever stands beside it.
    pub fn dots(&self, other: &Self) -> Vec<f64> {
        let n = self.columns;
        if n == 1 {
            return vec![vectorized(
                #[inline(always)]
                || dot(&self.data, &other.data),
            )];
        }
        // As `dot` does, column by column.
        let mut sums = vec![0.0; LANES * n];
        for i in 0..self.rows {
            let sums = &mut sums[i % LANES * n..][..n];
            for (sum, (a, b)) in sums.iter_mut().zip(self.row(i).iter().zip(other.row(i))) {
                *sum += a * b;
            }
        }
        let column = |k: usize| (0..LANES).map(|lane| sums[lane * n + k]).sum();
        (0..n).map(column).collect()
    }

    /// `self += other · diag(scale)`.
    pub fn add_scaled(&mut self, other: &Self, scale: &[f64]) {
        let n = self.columns;
        if let [scale] = *scale {
            let each = self.data.iter_mut().zip(&other.data);
            return each.for_each(|(a, b)| *a += b * scale);
        }
        if n == 0 {
            return;
        }
        for (i, b) in other.data.chunks_exact(n).enumerate() {
            let row = self.data[i * n..].iter_mut().zip(b).zip(scale);
            row.for_each(|((a, b), s)| *a += b * s);
        }
    }
}

/// Σ aᵢ bᵢ in lanes that are added up at the end: in [`vectorized`] as fast as the processor's vectors are wide.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (mut whole, mut others) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    for (a, b) in (&mut whole).zip(&mut others) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += a * b;
        }
    }
    let rest = whole.remainder().iter().zip(others.remainder());
    for (lane, (a, b)) in lanes.iter_mut().zip(rest) {
        *lane += a * b;
    }
    lanes.iter().sum()
}

impl Columnwise for Columns {
    fn count(&self) -> usize {
        self.columns
    }

    fn beside(&self, other: &Self) -> Self {
        let n = self.columns;
        Self::from_fn(self.rows, n + other.columns, |i, k| {
            if k < n {
                self.at(i, k)
            } else {
                other.at(i, k - n)
            }
        })
    }

    fn split(&self, n: usize) -> (Self, Self) {
        (
            Self::from_fn(self.rows, n, |i, k| self.at(i, k)),
            Self::from_fn(self.rows, self.columns - n, |i, k| self.at(i, n + k)),
        )
    }

    fn sum(alpha: f64, x: &Self, beta: f64, y: &Self) -> Self {
        let pairs = x.data.iter().zip(&y.data);
        Self {
            rows: x.rows,
            columns: x.columns,
            data: pairs.map(|(x, y)| alpha * x + beta * y).collect(),
        }
    }
}
