//! Extreme eigenvalues and condition numbers.

use super::Columns;
use crate::adjoint::sample;
use nalgebra::{Complex, DMatrix, DVector, linalg::Schur};

/// Most and least steps of an estimate.
const STEPS: usize = 24;
const LEAST: usize = 8;

/// Largest eigenvalue of a symmetric positive operator on vectors of length `n`, estimated from below by at most
/// [`STEPS`] steps of Lanczos with full orthogonalisation, until it changes by less than a ten-thousandth. Infinite where a
/// number isn't finite.
///
/// # References
/// C. Lanczos, J. Res. Natl. Bur. Stand. 45 (1950) 255; B. N. Parlett, The Symmetric Eigenvalue Problem (1980), §6.9 (twice
/// is enough).
pub fn largest_eigenvalue(n: usize, apply: impl Fn(&Columns) -> Columns) -> f64 {
    let mut w = Columns::from_columns(&[&sample::numbers(0, n, 1.0)]);
    let length = |x: &Columns| x.dots(x)[0].sqrt();
    let mut size = length(&w);
    let mut basis: Vec<Columns> = Vec::new();
    let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut best = 0.0;
    for step in 0..STEPS.min(n) {
        w.data.iter_mut().for_each(|x| *x /= size);
        basis.push(w);
        w = apply(&basis[step]);
        diagonal.push(w.dots(&basis[step])[0]);
        // Twice is enough.
        for v in basis.iter().chain(&basis) {
            let product = w.dots(v)[0];
            w.add_scaled(v, &[-product]);
        }
        size = length(&w);
        if !(diagonal[step].is_finite() && size.is_finite()) {
            return f64::INFINITY;
        }
        let tridiagonal = DMatrix::from_fn(step + 1, step + 1, |i, j| match i.abs_diff(j) {
            0 => diagonal[i],
            1 => beside[i.min(j)],
            _ => 0.0,
        });
        let next = tridiagonal.symmetric_eigenvalues().max();
        let settled = step >= LEAST && next - best <= 1e-4 * next;
        best = next;
        if settled || size <= f64::EPSILON * best {
            break;
        }
        beside.push(size);
    }
    best
}

/// Condition number σmax/σmin of a matrix A from the largest eigenvalues of AᵀA and of its inverse; infinite where it
/// isn't a number.
pub fn condition(largest: f64, inverse: f64) -> f64 {
    let condition = (largest * inverse).sqrt();
    if condition.is_finite() {
        condition
    } else {
        f64::INFINITY
    }
}

/// Steps of the QR iteration, for each row, within which Schur's form is found.
const ROTATIONS: usize = 100;

/// L⁻¹ S L⁻ᵀ, which has the eigenvalues of M⁻¹ S, M = L Lᵀ. None where numbers aren't finite.
pub fn scaled_by(lower: &DMatrix<f64>, s: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let half = lower.solve_lower_triangular(s)?;
    let scaled = lower.solve_lower_triangular(&half.transpose())?.transpose();
    scaled.iter().all(|x| x.is_finite()).then_some(scaled)
}

/// Eigenvalues of a square matrix; none where they aren't found.
pub fn eigenvalues(a: DMatrix<f64>) -> Option<DVector<Complex<f64>>> {
    let steps = ROTATIONS * a.nrows();
    Some(Schur::try_new(a, f64::EPSILON, steps)?.complex_eigenvalues())
}

/// The largest real part of the eigenvalues of a square matrix: the rate at which ẋ = A x grows in the end. That of its symmetric part bounds it, and says how fast x may grow
/// at first: of what acts one way only, as a propeller's speed on a hull, as fast as one likes to scale it.
pub fn growth(a: DMatrix<f64>) -> f64 {
    let bound = || (0.5 * (&a + a.transpose())).symmetric_eigenvalues().max();
    let largest =
        |found: DVector<Complex<f64>>| found.iter().map(|x| x.re).fold(f64::NEG_INFINITY, f64::max);
    eigenvalues(a.clone()).map_or_else(bound, largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn growth_is_that_in_the_end() {
        // One way: its symmetric part grows at 500.
        assert!((growth(dmatrix![-1.0, 1000.0; 0.0, -2.0]) + 1.0).abs() < 1e-9);
        // A swing that grows: 0.3 ± 2 i.
        assert!((growth(dmatrix![0.3, 2.0; -2.0, 0.3]) - 0.3).abs() < 1e-12);
        let a = dmatrix![2.0, 0.4, 0.1; 0.4, 1.0, 0.3; 0.1, 0.3, -1.0];
        let most = a.clone().symmetric_eigenvalues().max();
        assert!((growth(a) - most).abs() < 1e-12);
    }

    #[test]
    fn scaled_matrices_keep_eigenvalues() {
        let m = dmatrix![2.0, 0.5; 0.5, 1.0];
        let s = dmatrix![0.7, -3.0; 1.0, 0.2];
        let factor = m.cholesky().unwrap();
        let scaled = scaled_by(&factor.l(), &s).unwrap();
        let plain = factor.inverse() * &s;
        assert!((scaled.trace() - plain.trace()).abs() < 1e-12);
        assert!((scaled.determinant() - plain.determinant()).abs() < 1e-12);
        assert!(scaled_by(&dmatrix![1e-200], &dmatrix![1.0]).is_none());
    }
}
