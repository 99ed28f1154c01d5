//! Condition numbers from what conjugate gradients did.

use nalgebra::DMatrix;

/// Least and largest eigenvalue of the tridiagonal matrix that `steps` conjugate gradients with these coefficients make: those of the system, from within (Golub and Van Loan, Matrix
/// Computations, 10.2). `None` of no step.
pub(super) fn extremes(
    steps: usize,
    alpha: impl Fn(usize) -> f64,
    beta: impl Fn(usize) -> f64,
) -> Option<[f64; 2]> {
    let mut lanczos = DMatrix::zeros(steps, steps);
    for j in 0..steps {
        lanczos[(j, j)] = 1.0 / alpha(j);
        if j > 0 {
            lanczos[(j, j)] += beta(j - 1) / alpha(j - 1);
            let beside = beta(j - 1).max(0.0).sqrt() / alpha(j - 1);
            lanczos[(j, j - 1)] = beside;
            lanczos[(j - 1, j)] = beside;
        }
    }
    let eigenvalues = (steps > 0).then(|| lanczos.symmetric_eigenvalues())?;
    Some([eigenvalues.min(), eigenvalues.max()])
}
