//! Cholesky factors of sparse matrices, by faer, in an order of elimination that is given.

use super::CALLS;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::Perm;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
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
    matrix: SymbolicSparseColMat<usize>,
    sorted: Argsort<usize>,
    factor: SymbolicCholesky<usize>,
}

impl SparsePattern {
    /// Of rows that are eliminated in this order, and the entries at these rows and columns, of which those above the diagonal aren't read and equal ones add up. `None`
    /// where one lies outside or `order` isn't one of the rows.
    pub fn new(order: &[usize], entries: &[(usize, usize)]) -> Option<Self> {
        let size = order.len();
        let mut inverse = vec![usize::MAX; size];
        for (at, row) in order.iter().enumerate() {
            *inverse.get_mut(*row)? = at;
        }
        if inverse.contains(&usize::MAX) {
            return None;
        }
        let order = Perm::new_checked(order.into(), inverse.into(), size);
        let entries: Vec<_> = entries.iter().map(|&(i, j)| Pair::new(i, j)).collect();
        let (matrix, sorted) =
            SymbolicSparseColMat::try_new_from_indices(size, size, &entries).ok()?;
        let order = SymmetricOrdering::Custom(order.as_ref());
        let factor =
            factorize_symbolic_cholesky(matrix.as_ref(), Side::Lower, order, Default::default());
        Some(Self {
            matrix,
            sorted,
            factor: factor.ok()?,
        })
    }

    /// Factors matrices with these values of the entries; `None` where one isn't positive definite.
    pub fn factor<const N: usize>(
        self: &Arc<Self>,
        values: &[[f64; N]],
    ) -> Option<SparseCholesky<N>> {
        CALLS.add(1);
        let factor = &self.factor;
        let needed = factor.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut buffer = MemBuffer::new(needed);
        let mut factors = std::array::from_fn(|_| vec![0.0; factor.len_val()]);
        for (k, out) in factors.iter_mut().enumerate() {
            let values: Vec<f64> = values.iter().map(|v| v[k]).collect();
            let matrix = SparseColMat::new_from_argsort(self.matrix.clone(), &self.sorted, &values);
            factor
                .factorize_numeric_llt(
                    out,
                    matrix.ok()?.as_ref(),
                    Side::Lower,
                    Default::default(),
                    Par::Seq,
                    MemStack::new(&mut buffer),
                    Default::default(),
                )
                .ok()?;
        }
        Some(SparseCholesky {
            pattern: self.clone(),
            factors,
        })
    }
}

/// Factors of sparse symmetric positive definite matrices.
pub struct SparseCholesky<const N: usize> {
    pattern: Arc<SparsePattern>,
    factors: [Vec<f64>; N],
}

impl<const N: usize> SparseCholesky<N> {
    /// `x ← A⁻¹ x` of each matrix, a value a row.
    pub fn solve(&self, x: &mut [[f64; N]]) {
        CALLS.add(1);
        let symbolic = &self.pattern.factor;
        let mut buffer = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let mut column = vec![0.0; x.len()];
        for (k, values) in self.factors.iter().enumerate() {
            (column.iter_mut().zip(&*x)).for_each(|(to, from)| *to = from[k]);
            let right = MatMut::from_column_major_slice_mut(&mut column, x.len(), 1);
            let stack = MemStack::new(&mut buffer);
            LltRef::new(symbolic, values).solve_in_place_with_conj(
                Conj::No,
                right,
                Par::Seq,
                stack,
            );
            (x.iter_mut().zip(&column)).for_each(|(to, from)| to[k] = *from);
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
        assert!(patterns[0].factor.len_val() < patterns[1].factor.len_val());
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
