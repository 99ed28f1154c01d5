//! The largest modes of a symmetric matrix.

use crate::adjoint::sample;
use faer::{Mat, Side};

/// Columns that the search starts with, and how many more it tries at a time.
const START: usize = 64;
/// Times that the matrix is applied to the search space.
const POWERS: usize = 3;

/// Modes with values above `cut` times the largest, largest first, and the most negative value found.
pub(super) struct Modes {
    pub values: Vec<f64>,
    /// One column each.
    pub vectors: Mat<f64>,
    pub lowest: f64,
}

/// By powers of the matrix on a space of fixed pseudo-random columns, made larger until it holds all
/// modes above the cut (Halko, Martinsson & Tropp 2011). `None` if the eigenvalues of the small matrix
/// aren't found.
pub(super) fn largest(a: &Mat<f64>, cut: f64) -> Option<Modes> {
    let n = a.nrows();
    let mut k = START.min(n);
    loop {
        let mut space = Mat::from_fn(n, k, noise);
        for _ in 0..POWERS {
            space = a * orthonormal(&space);
        }
        let q = orthonormal(&space);
        let small = q.transpose() * (a * &q);
        let small = Mat::from_fn(k, k, |i, j| 0.5 * (small[(i, j)] + small[(j, i)]));
        let eigen = small.self_adjoint_eigen(Side::Lower).ok()?;
        let value = |i: usize| eigen.S()[i];
        let top = value(k - 1);
        let kept: Vec<usize> = (0..k).rev().filter(|i| value(*i) > cut * top).collect();
        // Modes near the end of the space aren't converged.
        if 4 * kept.len() <= 3 * k || k == n {
            let vectors = Mat::from_fn(k, kept.len(), |i, j| eigen.U()[(i, kept[j])]);
            return Some(Modes {
                values: kept.iter().map(|i| value(*i)).collect(),
                vectors: &q * vectors,
                lowest: value(0).min(0.0),
            });
        }
        k = (2 * k).min(n);
    }
}

fn orthonormal(a: &Mat<f64>) -> Mat<f64> {
    a.qr().compute_thin_Q()
}

/// A fixed number between −1 and 1.
fn noise(i: usize, j: usize) -> f64 {
    sample::bits((i as u64) << 32 | j as u64) as f64 / (u64::MAX / 2) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::largest;
    use faer::Mat;

    #[test]
    fn largest_modes_are_those_of_a_matrix_with_known_ones() {
        let n = 150;
        // Householder reflections of a diagonal matrix.
        let u: Vec<f64> = (0..n).map(|i| (1.3 * i as f64).sin()).collect();
        let norm: f64 = u.iter().map(|x| x * x).sum();
        let h = Mat::from_fn(n, n, |i, j| {
            f64::from(u8::from(i == j)) - 2.0 * u[i] * u[j] / norm
        });
        let values: Vec<f64> = (0..n)
            .map(|k| {
                if k == 100 {
                    -1e-3
                } else {
                    0.8f64.powi(k as i32)
                }
            })
            .collect();
        let a = Mat::from_fn(n, n, |i, j| {
            (0..n)
                .map(|k| h[(i, k)] * values[k] * h[(j, k)])
                .sum::<f64>()
        });
        let modes = largest(&a, 1e-3).unwrap();
        assert_eq!(modes.values.len(), 31);
        for (k, value) in modes.values.iter().enumerate() {
            assert!((value / values[k] - 1.0).abs() < 1e-6, "{k} {value}");
            let overlap: f64 = (0..n).map(|i| modes.vectors[(i, k)] * h[(i, k)]).sum();
            assert!((overlap.abs() - 1.0).abs() < 1e-6);
        }
        assert!((modes.lowest + 1e-3).abs() < 1e-4);
    }
}
