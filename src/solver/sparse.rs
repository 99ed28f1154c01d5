//! Cholesky factors of sparse matrices.

use super::CALLS;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{MatMut, Side, linalg::solvers::SolveCore};

/// Where a sparse symmetric matrix has entries, and what its factors fill: made once for matrices that differ in their values.
pub struct SparsePattern {
    matrix: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    factor: SymbolicLlt<usize>,
}

impl SparsePattern {
    /// Of the entries at these rows and columns, of which those above the diagonal aren't read and equal ones add up; `None` where one lies outside.
    pub fn new(size: usize, entries: &[(usize, usize)]) -> Option<Self> {
        let entries: Vec<_> = entries.iter().map(|&(i, j)| Pair::new(i, j)).collect();
        let (matrix, order) =
            SymbolicSparseColMat::try_new_from_indices(size, size, &entries).ok()?;
        let factor = SymbolicLlt::try_new(matrix.as_ref(), Side::Lower).ok()?;
        Some(Self {
            matrix,
            order,
            factor,
        })
    }

    /// Factors the matrix with these values of the entries; `None` where it isn't positive definite.
    pub fn factor(&self, values: &[f64]) -> Option<SparseCholesky> {
        CALLS.add(1);
        let matrix = SparseColMat::new_from_argsort(self.matrix.clone(), &self.order, values);
        let symbolic = self.factor.clone();
        let factor = Llt::try_new_with_symbolic(symbolic, matrix.ok()?.as_ref(), Side::Lower);
        Some(SparseCholesky {
            factor: factor.ok()?,
        })
    }
}

/// Factor of a sparse symmetric positive definite matrix.
pub struct SparseCholesky {
    factor: Llt<usize, f64>,
}

impl SparseCholesky {
    /// `x ← A⁻¹ x`, x size × columns.
    pub fn solve(&self, x: MatMut<'_, f64>) {
        CALLS.add(1);
        self.factor.solve_in_place_with_conj(faer::Conj::No, x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};

    #[test]
    fn solves_and_refuses() {
        let right = DMatrix::from_fn(3, 2, |i, j| (1 + i + 3 * j) as f64);
        // The second diagonal entry in two parts.
        let entries = [(0, 0), (1, 0), (1, 1), (1, 1), (2, 1), (2, 2)];
        let pattern = SparsePattern::new(3, &entries).expect("inside");
        for scale in [1.0, 3.0] {
            let a = scale * dmatrix![4.0, 1.0, 0.0; 1.0, 3.0, 0.2; 0.0, 0.2, 9.0];
            let values = [4.0, 1.0, 2.0, 1.0, 0.2, 9.0].map(|x| scale * x);
            let factor = pattern.factor(&values).expect("definite");
            let mut x = right.clone();
            factor.solve(MatMut::from_column_major_slice_mut(x.as_mut_slice(), 3, 2));
            assert!((a * x - &right).amax() < 1e-14);
        }
        let pattern = SparsePattern::new(2, &[(0, 0), (1, 0), (1, 1)]).expect("inside");
        assert!(pattern.factor(&[1.0, 2.0, 1.0]).is_none());
        assert!(SparsePattern::new(1, &[(1, 1)]).is_none());
    }
}
