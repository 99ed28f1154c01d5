//! Sparse matrices by rows, and their products with a few columns.

use super::{CALLS, Columns};
use rayon::prelude::*;

/// Rows that a task multiplies.
const TASK: usize = 256;

/// A sparse matrix, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseRows {
    /// Where each row's entries start; one more for the end.
    starts: Vec<usize>,
    /// Columns and values.
    entries: Vec<(usize, f64)>,
}

impl SparseRows {
    /// From rows of (column, value).
    pub fn new(rows: impl Iterator<Item = Vec<(usize, f64)>>) -> Self {
        let (mut starts, mut entries) = (vec![0], Vec::new());
        for row in rows {
            entries.extend(row);
            starts.push(entries.len());
        }
        Self { starts, entries }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether it has no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// One row: (column, value) of its entries.
    pub fn row(&self, i: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[i]..self.starts[i + 1]]
    }

    /// Its transpose, of so many rows.
    ///
    /// # Panics
    /// Where it has more columns than that.
    pub fn transposed(&self, rows: usize) -> Self {
        let mut starts = vec![0; rows + 1];
        for (j, _) in &self.entries {
            starts[j + 1] += 1;
        }
        for j in 0..rows {
            starts[j + 1] += starts[j];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); self.entries.len()];
        for i in 0..self.len() {
            for (j, value) in self.row(i) {
                entries[next[*j]] = (i, *value);
                next[*j] += 1;
            }
        }
        Self { starts, entries }
    }

    /// Its product with some columns.
    ///
    /// # Panics
    /// Where those have fewer rows than it has columns.
    pub fn product(&self, x: &Columns) -> Columns {
        CALLS.add(1);
        let n = x.columns;
        let mut out = Columns::zeros(self.len(), n);
        if n == 0 {
            return out;
        }
        let tasks = out.data.par_chunks_mut(TASK * n).enumerate();
        tasks.for_each(|(task, rows)| {
            for (i, sums) in rows.chunks_exact_mut(n).enumerate() {
                for (j, value) in self.row(task * TASK + i) {
                    for (sum, x) in sums.iter_mut().zip(x.row(*j)) {
                        *sum += value * x;
                    }
                }
            }
        });
        out
    }
}
