//! Matrices that tie no velocity of one island to one of another: they take as much room as there are velocities, times those of the largest island.

use super::islands::Islands;
use crate::adjoint::solve::General;
use nalgebra::{DMatrix, DVector};

/// Fewest velocities from which on islands are kept apart; one matrix of all is as fast below.
pub(super) const MANY: usize = 96;

/// A matrix of all velocities without entries between islands. Where all are one island it is the whole matrix.
#[derive(Clone)]
pub(super) struct IslandMatrix {
    islands: Islands,
    /// Row by row its entries in the columns of the row's own island.
    columns: DMatrix<f64>,
}

impl IslandMatrix {
    /// The matrix whose products with [`Islands::changes`] these are.
    pub fn new(islands: Islands, products: &[DVector<f64>]) -> Self {
        if islands.velocities() < MANY || islands.is_whole() {
            return Self::whole(islands.matrix(products));
        }
        let columns = match products.is_empty() {
            true => DMatrix::zeros(islands.velocities(), 0),
            false => DMatrix::from_columns(products),
        };
        Self { islands, columns }
    }

    /// Any matrix.
    pub fn whole(matrix: DMatrix<f64>) -> Self {
        Self {
            islands: Islands::whole(matrix.nrows()),
            columns: matrix,
        }
    }

    /// Whether all is one island.
    pub fn is_whole(&self) -> bool {
        self.islands.is_whole()
    }

    /// What becomes of it where each column becomes what `map` makes of it: linear, and within islands.
    pub fn mapped(&self, map: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        Self {
            islands: self.islands.clone(),
            columns: map(&self.columns),
        }
    }

    /// Whether all entries are zero.
    pub fn is_zero(&self) -> bool {
        self.columns.iter().all(|x| *x == 0.0)
    }

    /// Less another matrix of the same islands.
    pub fn minus(&self, other: &Self) -> Self {
        self.mapped(|columns| columns - &other.columns)
    }

    /// Subtracts entries, each of which lies within an island.
    pub fn subtract(&mut self, entries: impl Iterator<Item = (usize, usize, f64)>) {
        for (i, j, x) in entries {
            let column = self.islands.place(j);
            self.columns[(i, column)] -= x;
        }
    }

    /// ½ (A + Aᵀ).
    pub fn symmetric(&self) -> Self {
        let mut out = self.clone();
        for (island, block) in self.blocks() {
            let block = 0.5 * (&block + block.transpose());
            for (i, row) in island.iter().zip(block.row_iter()) {
                let mut to = out.columns.view_mut((*i, 0), (1, island.len()));
                to.copy_from(&row);
            }
        }
        out
    }

    /// The block of each island, with its velocities.
    pub fn blocks(&self) -> impl Iterator<Item = (&[usize], DMatrix<f64>)> {
        self.islands.each().map(|island| {
            let block = match self.is_whole() {
                true => self.columns.clone(),
                false => DMatrix::from_fn(island.len(), island.len(), |i, k| {
                    self.columns[(island[i], k)]
                }),
            };
            (island, block)
        })
    }

    /// Hands `add` the entries of its symmetric part on and below the diagonal: row, column, value.
    pub fn lower(&self, mut add: impl FnMut(usize, usize, f64)) {
        for (island, block) in self.blocks() {
            for (k, i) in island.iter().enumerate() {
                for (l, j) in island.iter().enumerate().take(k + 1) {
                    let x = 0.5 * (block[(k, l)] + block[(l, k)]);
                    if x != 0.0 {
                        add(*i, *j, x);
                    }
                }
            }
        }
    }

    /// The block of each island on the rows and columns of its velocities that are free, with their numbers among the free ones, which ascend.
    pub fn free_blocks<'b>(
        &'b self,
        free: &'b [usize],
    ) -> impl Iterator<Item = (Vec<usize>, DMatrix<f64>)> + 'b {
        self.islands.each().filter_map(move |island| {
            let number = |i: &usize| free.binary_search(i).ok();
            let rows: Vec<usize> = island.iter().filter_map(number).collect();
            let at = |row: usize| free[rows[row]];
            let block = DMatrix::from_fn(rows.len(), rows.len(), |i, k| {
                self.columns[(at(i), self.islands.place(at(k)))]
            });
            (!rows.is_empty()).then_some((rows, block))
        })
    }

    /// Its diagonal.
    pub fn diagonal(&self) -> DVector<f64> {
        let entry = |i: usize| self.columns[(i, self.islands.place(i))];
        DVector::from_fn(self.columns.nrows(), |i, _| entry(i))
    }

    /// A x.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        if self.is_whole() {
            return &self.columns * x;
        }
        let mut out = DVector::zeros(x.len());
        for island in self.islands.each() {
            for i in island {
                let row = island.iter().enumerate();
                out[*i] = row.map(|(k, j)| self.columns[(*i, k)] * x[*j]).sum();
            }
        }
        out
    }

    /// Aᵀ x.
    pub fn tr_times(&self, x: &DVector<f64>) -> DVector<f64> {
        if self.is_whole() {
            return self.columns.tr_mul(x);
        }
        let mut out = DVector::zeros(x.len());
        for island in self.islands.each() {
            for (k, j) in island.iter().enumerate() {
                out[*j] = island.iter().map(|i| self.columns[(*i, k)] * x[*i]).sum();
            }
        }
        out
    }

    /// All of it, zeros included.
    pub fn dense(&self) -> DMatrix<f64> {
        if self.is_whole() {
            return self.columns.clone();
        }
        let mut out = DMatrix::zeros(self.columns.nrows(), self.columns.nrows());
        for island in self.islands.each() {
            for i in island {
                for (k, j) in island.iter().enumerate() {
                    out[(*i, *j)] = self.columns[(*i, k)];
                }
            }
        }
        out
    }

    /// Factors the free rows and columns of it, or of its transpose.
    pub fn factored(&self, free: &[usize], transposed: bool) -> IslandFactor {
        let each = self.free_blocks(free).map(|(rows, block)| {
            let block = if transposed { block.transpose() } else { block };
            (rows, General::new(block))
        });
        IslandFactor(each.collect())
    }
}

/// Factors of the blocks of an [`IslandMatrix`] on the free velocities, with their numbers among these.
pub(super) struct IslandFactor(Vec<(Vec<usize>, General)>);

impl IslandFactor {
    /// x with A x = `b`; `None` of a singular matrix.
    pub fn solve(&self, b: &DVector<f64>) -> Option<DVector<f64>> {
        if let [(_, whole)] = self.0.as_slice() {
            return whole.solve(b);
        }
        let mut out = DVector::zeros(b.len());
        for (rows, factor) in &self.0 {
            let found = factor.solve(&b.select_rows(rows))?;
            for (i, x) in rows.iter().zip(found.iter()) {
                out[*i] = *x;
            }
        }
        Some(out)
    }

    /// The same of every column.
    pub fn solve_columns(&self, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        if let [(_, whole)] = self.0.as_slice() {
            return whole.solve_columns(b);
        }
        let mut out = DMatrix::zeros(b.nrows(), b.ncols());
        for (rows, factor) in &self.0 {
            let found = factor.solve_columns(&b.select_rows(rows))?;
            for (i, x) in rows.iter().zip(found.row_iter()) {
                out.row_mut(*i).copy_from(&x);
            }
        }
        Some(out)
    }
}
