//! Cholesky factors of sparse matrices.
//!
//! Several matrices with entries at the same places are factored together: what is looked up is looked up once. The factor L Lᵀ is made column by column, each from the
//! columns before it that reach down to it.
//!
//! # References
//! T. A. Davis, "Direct Methods for Sparse Linear Systems", SIAM 2006, chapter 4.

use super::CALLS;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::amd;
use faer::sparse::{Pair, SymbolicSparseColMat};
use std::sync::Arc;

/// An order of a symmetric matrix' rows in which its factor fills little, by approximate minimum degree; `None` where an entry lies outside.
pub fn elimination_order(size: usize, entries: &[(usize, usize)]) -> Option<Vec<usize>> {
    let both = entries.iter().flat_map(|&(i, j)| [(i, j), (j, i)]);
    let pairs: Vec<_> = both.map(|(i, j)| Pair::new(i, j)).collect();
    let (matrix, _) = SymbolicSparseColMat::try_new_from_indices(size, size, &pairs).ok()?;
    let [mut order, mut inverse] = [vec![0; size], vec![0; size]];
    let needed = amd::order_maybe_unsorted_scratch::<usize>(size, matrix.row_idx().len());
    let mut buffer = MemBuffer::new(needed);
    amd::order_maybe_unsorted(
        &mut order,
        &mut inverse,
        matrix.as_ref(),
        Default::default(),
        MemStack::new(&mut buffer),
    )
    .ok()?;
    Some(order)
}

/// Where a sparse symmetric matrix has entries, and what its factor fills: made once for matrices that differ in their values.
pub struct SparsePattern {
    /// When each row is eliminated.
    place: Vec<usize>,
    /// Where the columns of the factor begin and end below the diagonal.
    starts: Vec<usize>,
    /// The rows there, column after column.
    rows: Vec<u32>,
    /// Of each column, where the columns before it have its row, and where these end.
    reach: Vec<Vec<(u32, u32)>>,
    /// Where each entry goes: the diagonal, and then what is below it.
    slots: Vec<usize>,
}

impl SparsePattern {
    /// Of rows that are eliminated in this order. An entry (i, j) stands for (j, i) as well, and equal ones add up. `None` where one lies outside or `order` isn't
    /// one of the rows.
    pub fn new(order: &[usize], entries: &[(usize, usize)]) -> Option<Self> {
        let size = order.len();
        let mut place = vec![usize::MAX; size];
        for (at, row) in order.iter().enumerate() {
            *place.get_mut(*row)? = at;
        }
        if place.contains(&usize::MAX) {
            return None;
        }
        let mut below = vec![Vec::new(); size];
        let mut placed = Vec::with_capacity(entries.len());
        for &(i, j) in entries {
            let (i, j) = (*place.get(i)?, *place.get(j)?);
            let (row, column) = (i.max(j), i.min(j));
            placed.push((row, column));
            if row != column {
                below[column].push(row as u32);
            }
        }
        let (mut starts, mut rows) = (vec![0], Vec::<u32>::new());
        let mut children = vec![Vec::new(); size];
        let mut seen = vec![usize::MAX; size];
        for column in 0..size {
            let from = rows.len();
            seen[column] = column;
            let mut add = |row: u32, rows: &mut Vec<u32>| {
                if std::mem::replace(&mut seen[row as usize], column) != column {
                    rows.push(row);
                }
            };
            below[column].iter().for_each(|row| add(*row, &mut rows));
            for child in std::mem::take(&mut children[column]) {
                for at in starts[child]..starts[child + 1] {
                    add(rows[at], &mut rows);
                }
            }
            rows[from..].sort_unstable();
            if let Some(parent) = rows.get(from) {
                children[*parent as usize].push(column);
            }
            starts.push(rows.len());
        }
        let mut reach = vec![Vec::new(); size];
        for ends in starts.windows(2) {
            for at in ends[0]..ends[1] {
                reach[rows[at] as usize].push((at as u32, ends[1] as u32));
            }
        }
        let slot = |(row, column): (usize, usize)| {
            if row == column {
                return Some(row);
            }
            let (from, to) = (starts[column], starts[column + 1]);
            let at = rows[from..to].binary_search(&(row as u32)).ok()?;
            Some(size + from + at)
        };
        let slots = placed.into_iter().map(slot).collect::<Option<_>>()?;
        Some(Self {
            place,
            starts,
            rows,
            reach,
            slots,
        })
    }

    /// Factors matrices with these values of the entries; `None` where one isn't positive definite.
    pub fn factor<const N: usize>(
        self: &Arc<Self>,
        values: &[[f64; N]],
    ) -> Option<SparseCholesky<N>> {
        CALLS.add(1);
        let size = self.place.len();
        let mut all = vec![[0.0; N]; size + self.rows.len()];
        for (slot, values) in self.slots.iter().zip(values) {
            (0..N).for_each(|k| all[*slot][k] += values[k]);
        }
        let below = all.split_off(size);
        let mut out = SparseCholesky {
            pattern: self.clone(),
            inverse: all,
            below,
        };
        // Where the column has each row.
        let mut at = vec![0; size];
        for column in 0..size {
            let (from, to) = (self.starts[column], self.starts[column + 1]);
            for (k, row) in self.rows[from..to].iter().enumerate() {
                at[*row as usize] = k;
            }
            let (done, open) = out.below.split_at_mut(from);
            let open = &mut open[..to - from];
            let mut diagonal = out.inverse[column];
            for &(first, end) in &self.reach[column] {
                let (first, end) = (first as usize, end as usize);
                let factor = done[first];
                (0..N).for_each(|k| diagonal[k] -= factor[k] * factor[k]);
                let further = &done[first + 1..end];
                for (row, value) in self.rows[first + 1..end].iter().zip(further) {
                    let target = &mut open[at[*row as usize]];
                    (0..N).for_each(|k| target[k] -= factor[k] * value[k]);
                }
            }
            if !diagonal.iter().all(|x| *x > 0.0 && x.is_finite()) {
                return None;
            }
            let inverse = diagonal.map(|x| x.sqrt().recip());
            out.inverse[column] = inverse;
            for value in open {
                (0..N).for_each(|k| value[k] *= inverse[k]);
            }
        }
        Some(out)
    }
}

/// Factors of sparse symmetric positive definite matrices.
pub struct SparseCholesky<const N: usize> {
    pattern: Arc<SparsePattern>,
    /// One over what is on the diagonal.
    inverse: Vec<[f64; N]>,
    below: Vec<[f64; N]>,
}

impl<const N: usize> SparseCholesky<N> {
    /// `x ← A⁻¹ x` of each matrix, a value a row.
    pub fn solve(&self, x: &mut [[f64; N]]) {
        CALLS.add(1);
        let p = &*self.pattern;
        let mut y = vec![[0.0; N]; x.len()];
        for (value, place) in x.iter().zip(&p.place) {
            y[*place] = *value;
        }
        let column = |column: usize| {
            let range = p.starts[column]..p.starts[column + 1];
            p.rows[range.clone()].iter().zip(&self.below[range])
        };
        for (at, inverse) in self.inverse.iter().enumerate() {
            let found: [f64; N] = std::array::from_fn(|k| y[at][k] * inverse[k]);
            y[at] = found;
            for (row, value) in column(at) {
                let target = &mut y[*row as usize];
                (0..N).for_each(|k| target[k] -= value[k] * found[k]);
            }
        }
        for (at, inverse) in self.inverse.iter().enumerate().rev() {
            let mut left = y[at];
            for (row, value) in column(at) {
                let known = y[*row as usize];
                (0..N).for_each(|k| left[k] -= value[k] * known[k]);
            }
            y[at] = std::array::from_fn(|k| left[k] * inverse[k]);
        }
        for (value, place) in x.iter_mut().zip(&p.place) {
            *value = y[*place];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjoint::sample::Samples;
    use nalgebra::{DMatrix, DVector, dmatrix};

    #[test]
    fn solves_and_refuses() {
        // The second diagonal entry in two parts.
        let entries = [(0, 0), (1, 0), (1, 1), (1, 1), (2, 1), (2, 2)];
        for order in [[0, 1, 2], [2, 0, 1]] {
            let pattern = Arc::new(SparsePattern::new(&order, &entries).expect("inside"));
            let a = dmatrix![4.0, 1.0, 0.0; 1.0, 3.0, 0.2; 0.0, 0.2, 9.0];
            let values = [4.0, 1.0, 2.0, 1.0, 0.2, 9.0].map(|x| [x, 3.0 * x]);
            let factor = pattern.factor(&values).expect("definite");
            let mut x = [[1.0; 2], [2.0; 2], [3.0; 2]];
            factor.solve(&mut x);
            for (k, scale) in [1.0, 3.0].into_iter().enumerate() {
                let x = DVector::from_fn(3, |i, _| scale * x[i][k]);
                assert!((&a * x - DVector::from_vec(vec![1.0, 2.0, 3.0])).amax() < 1e-14);
            }
        }
        let pattern = SparsePattern::new(&[0, 1], &[(0, 0), (1, 0), (1, 1)]).expect("inside");
        let pattern = Arc::new(pattern);
        assert!(pattern.factor(&[[1.0], [2.0], [1.0]]).is_none());
        assert!(SparsePattern::new(&[0], &[(1, 1)]).is_none());
        assert!(SparsePattern::new(&[0, 0], &[(1, 1)]).is_none());
    }

    /// A grid's matrix, which fills, in the order that fills little and in another.
    #[test]
    fn orders_only_save_work() {
        let (side, mut random) = (12, Samples::new(5));
        let size = side * side;
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        let mut dense = DMatrix::zeros(size, size);
        for i in 0..size {
            let (row, column) = (i / side, i % side);
            let right = (column > 0).then(|| i - 1);
            let up = (row > 0).then(|| i - side);
            for (j, x) in [(Some(i), 4.5), (right, -1.0), (up, -1.0)] {
                let Some(j) = j else { continue };
                let x = x + 0.1 * random.number();
                entries.push((i, j));
                values.push([x]);
                dense[(i, j)] = x;
                dense[(j, i)] = x;
            }
        }
        let order = elimination_order(size, &entries).expect("inside");
        let plain: Vec<usize> = (0..size).collect();
        let patterns = [&order, &plain].map(|o| SparsePattern::new(o, &entries).expect("inside"));
        assert!(patterns[0].rows.len() < patterns[1].rows.len());
        let right = DVector::from_fn(size, |_, _| random.number());
        for pattern in patterns {
            let factor = Arc::new(pattern).factor(&values).expect("definite");
            let mut x: Vec<[f64; 1]> = right.iter().map(|x| [*x]).collect();
            factor.solve(&mut x);
            let x = DVector::from_fn(size, |i, _| x[i][0]);
            assert!((&dense * x - &right).amax() < 1e-13);
        }
    }
}
