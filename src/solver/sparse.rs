//! Cholesky factors of sparse matrices.

use super::CALLS;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use faer::{MatMut, Side, linalg::solvers::SolveCore};

/// Factor of a sparse symmetric positive definite matrix.
pub struct SparseCholesky {
    factor: Llt<usize, f64>,
}

impl SparseCholesky {
    /// Factors the matrix of these entries (row, column, value), of which those above the diagonal aren't read and equal ones add up; `None` where it isn't positive
    /// definite, or an entry lies outside.
    pub fn new(size: usize, entries: &[(usize, usize, f64)]) -> Option<Self> {
        CALLS.add(1);
        let entries: Vec<_> = (entries.iter())
            .map(|&(i, j, x)| Triplet::new(i, j, x))
            .collect();
        let matrix = SparseColMat::try_new_from_triplets(size, size, &entries).ok()?;
        let factor = matrix.sp_cholesky(Side::Lower).ok()?;
        Some(Self { factor })
    }

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
        let a = dmatrix![4.0, 1.0, 0.0; 1.0, 3.0, 0.2; 0.0, 0.2, 9.0];
        let right = DMatrix::from_fn(3, 2, |i, j| (1 + i + 3 * j) as f64);
        // The second diagonal entry in two parts.
        let entries = [
            (0, 0, 4.0),
            (1, 0, 1.0),
            (1, 1, 2.0),
            (1, 1, 1.0),
            (2, 1, 0.2),
            (2, 2, 9.0),
        ];
        let factor = SparseCholesky::new(3, &entries).expect("definite");
        let mut x = right.clone();
        factor.solve(MatMut::from_column_major_slice_mut(x.as_mut_slice(), 3, 2));
        assert!((a * x - right).amax() < 1e-14);
        assert!(SparseCholesky::new(2, &[(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)]).is_none());
        assert!(SparseCholesky::new(1, &[(1, 1, 1.0)]).is_none());
    }
}
