//! Extreme eigenvalues and condition numbers.

use super::Columns;
use crate::adjoint::sample;
use nalgebra::DMatrix;

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
