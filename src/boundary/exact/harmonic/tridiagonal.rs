//! Eigenvalues and eigenvectors of a symmetric tridiagonal matrix by implicitly shifted QL.
//!
//! An off-diagonal entry is dropped only where it is rounding beside its neighbours on the diagonal, so
//! vectors keep slight mixtures; and where entries grow from the first to the last, small eigenvalues keep
//! their digits.
//!
//! # References
//! H. Bowdler, R. S. Martin, C. Reinsch, J. H. Wilkinson, "The QR and QL algorithms for symmetric matrices",
//! Numer. Math. 11 (1968) 293–306.

use faer::Mat;

/// Sweeps for one eigenvalue; two or three are usual.
const MOST: usize = 60;

/// Eigenvalues, in no order, and eigenvectors as columns; none if a sweep doesn't converge.
/// `beside[i]` couples rows i and i + 1.
pub(super) fn eigen(mut diagonal: Vec<f64>, mut beside: Vec<f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = diagonal.len();
    let mut vectors = Mat::identity(n, n);
    // Room for the entry that is chased out of the block's end.
    beside.push(0.0);
    for first in 0..n {
        let mut sweeps = 0;
        loop {
            let negligible = |i: &usize| {
                let size = diagonal[*i].abs() + diagonal[i + 1].abs();
                beside[*i].abs() <= f64::EPSILON * size
            };
            let last = (first..n - 1).find(negligible).unwrap_or(n - 1);
            if last == first {
                break;
            }
            sweeps += 1;
            if sweeps > MOST {
                return None;
            }
            sweep(&mut diagonal, &mut beside, &mut vectors, first, last);
        }
    }
    Some((diagonal, vectors))
}

/// One QL sweep of the block from row `first` to row `last`, shifted by the eigenvalue of its first 2 × 2
/// corner that is nearer to its first entry.
fn sweep(d: &mut [f64], e: &mut [f64], vectors: &mut Mat<f64>, first: usize, last: usize) {
    let half = (d[first + 1] - d[first]) / (2.0 * e[first]);
    let shift = d[first] - e[first] / (half + half.signum() * half.hypot(1.0));
    // Rotations from the last row up chase the bulge; `moved` is what the last one put on the diagonal.
    let (mut cos, mut sin, mut moved) = (1.0, 1.0, 0.0);
    let mut head = d[last] - shift;
    for i in (first..last).rev() {
        let (bulge, rest) = (sin * e[i], cos * e[i]);
        let length = bulge.hypot(head);
        e[i + 1] = length;
        if length == 0.0 {
            // The block falls apart here.
            d[i + 1] -= moved;
            e[last] = 0.0;
            return;
        }
        (sin, cos) = (bulge / length, head / length);
        let own = d[i + 1] - moved;
        let mixed = (d[i] - own) * sin + 2.0 * cos * rest;
        moved = sin * mixed;
        d[i + 1] = own + moved;
        head = cos * mixed - rest;
        let (left, right) = vectors.as_mut().split_at_col_mut(i + 1);
        let (left, right) = (left.col_mut(i), right.col_mut(0));
        for (x, y) in left.iter_mut().zip(right.iter_mut()) {
            (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
        }
    }
    d[first] -= moved;
    e[first] = head;
    e[last] = 0.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(diagonal: &[f64], beside: &[f64]) -> Vec<f64> {
        let n = diagonal.len();
        let (values, v) = eigen(diagonal.to_vec(), beside.to_vec()).unwrap();
        let t = Mat::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => diagonal[i],
            1 => beside[i.min(j)],
            _ => 0.0,
        });
        let scaled = Mat::from_fn(n, n, |i, j| v[(i, j)] * values[j]);
        assert!((&t * &v - scaled).norm_max() <= 1e-14 * n as f64 * t.norm_max());
        let unit = Mat::<f64>::identity(n, n);
        assert!((v.transpose() * &v - unit).norm_max() < 1e-14 * n as f64);
        values
    }

    #[test]
    fn the_second_difference() {
        let n = 80;
        let mut values = check(&vec![2.0; n], &vec![-1.0; n - 1]);
        values.sort_by(f64::total_cmp);
        for (k, value) in values.iter().enumerate() {
            let angle = std::f64::consts::PI * (k + 1) as f64 / (n + 1) as f64;
            assert!((value - 2.0 + 2.0 * angle.cos()).abs() < 1e-14);
        }
        check(&[3.0], &[]);
        check(&[0.0, 0.0, 0.0], &[0.0, 0.0]);
        check(&[0.0, 0.0, 1.0], &[1.0, 1e-200]);
    }

    /// A coupling far below the gap turns the vectors by its size, and small eigenvalues of a graded
    /// matrix keep their digits.
    #[test]
    fn slight_mixtures_and_small_values() {
        for slight in [1e-7, 1e-9, 1e-12] {
            let (_, v) = eigen(vec![0.0, 4.0, 16.0], vec![slight, slight]).unwrap();
            assert!((v[(1, 0)] / v[(0, 0)] / (-slight / 4.0) - 1.0).abs() < 1e-6);
            let values = check(&[slight, 4.0, 16.0], &[slight, slight]);
            let least = values.iter().fold(f64::INFINITY, |m: f64, v| m.min(*v));
            assert!((least / (slight - slight * slight / 4.0) - 1.0).abs() < 1e-14);
        }
    }
}
