//! Checks of what solves linear systems.

use super::{TOLERANCE, all};
use crate::check::{Outcome, outcome};
use crate::draw::numbers;
use crate::solve::{Definite, Fitted, Moved, least_squares, least_squares_jvp};
use nalgebra::{DMatrix, DVector};

fn matrix(seed: u64, rows: usize, columns: usize, size: f64) -> DMatrix<f64> {
    DMatrix::from_vec(rows, columns, numbers(seed, rows * columns, size))
}

/// A definite matrix and its right-hand side along a line: with the tangents of both.
struct Line {
    a: [DMatrix<f64>; 2],
    b: [DVector<f64>; 2],
}

impl Line {
    fn new(seed: u64) -> Self {
        let root = matrix(seed, 6, 6, 1.0);
        let da = matrix(seed + 1, 6, 6, 0.1);
        Self {
            a: [
                &root * root.transpose() + 0.5 * DMatrix::identity(6, 6),
                &da + da.transpose(),
            ],
            b: [2, 3].map(|k| DVector::from_vec(numbers(seed + k, 6, 1.0))),
        }
    }

    fn solve(&self, h: f64) -> DVector<f64> {
        let b = &self.b[0] + h * &self.b[1];
        self.factor(h).solve(&b)
    }

    fn factor(&self, h: f64) -> Definite {
        Definite::new(&self.a[0] + h * &self.a[1]).expect("a definite matrix")
    }
}

/// Several lines, each with a cotangent of the solution.
fn lines() -> impl Iterator<Item = (Line, DVector<f64>)> {
    [300, 310, 320, 330].into_iter().map(|seed| {
        let x_bar = numbers(seed + 4, 6, 1.0);
        (Line::new(seed), DVector::from_vec(x_bar))
    })
}

pub(super) fn solve_vjp_check(corruption: f64) -> Outcome {
    all(lines().map(|(line, x_bar)| {
        let (x, w) = (line.solve(0.0), line.factor(0.0).solve_vjp(&x_bar));
        let slope = w.dot(&line.b[1]) - w.dot(&(&line.a[1] * x));
        let value = |h: &[f64]| vec![line.solve(h[0]).dot(&x_bar)];
        outcome(value, &[0.0], &[1.0], &[corruption * slope], TOLERANCE)
    }))
}

/// All four of the solutions, as K and both right-hand sides move.
pub(super) fn least_squares_jvp_check(corruption: f64) -> Outcome {
    let (m, n, columns) = (12, 6, 2);
    let k = [matrix(90, m, n, 1.0), matrix(91, m, n, 0.1)];
    let f = [matrix(92, m, columns, 1.0), matrix(93, m, columns, 1.0)];
    let g = [matrix(94, n, columns, 1.0), matrix(95, n, columns, 1.0)];
    let at = |of: &[DMatrix<f64>; 2], h: f64| &of[0] + h * &of[1];
    let damping = DMatrix::from_diagonal_element(n, n, 0.3);
    let normal = |k: &DMatrix<f64>, b: &DMatrix<f64>| {
        let factor = (k.tr_mul(k) + &damping).cholesky().ok_or(());
        factor.map(|factor| (factor.solve(b), ()))
    };
    let solve = |h: f64| {
        let k = at(&k, h);
        let solved = least_squares(&k, |b| normal(&k, b), &at(&f, h), &at(&g, h));
        solved.expect("a definite matrix").0
    };
    let list = |s: &Fitted<DMatrix<f64>>| {
        let parts = [&s.a, &s.lambda, &s.r, &s.mu];
        parts.iter().flat_map(|p| p.iter().copied()).collect()
    };
    let start = solve(0.0);
    let moved = Moved {
        a: &(&k[1] * &start.a - &f[1]),
        lambda: &(&k[1] * &start.lambda),
        r: &k[1].tr_mul(&start.r),
        g: &(&g[1] - k[1].tr_mul(&start.mu)),
    };
    let tangent = least_squares_jvp(&k[0], |b| normal(&k[0], b), &moved);
    let tangent: Vec<f64> = list(&tangent.expect("a definite matrix").0);
    let tangent: Vec<f64> = tangent.iter().map(|t| corruption * t).collect();
    outcome(|h| list(&solve(h[0])), &[0.0], &[1.0], &tangent, TOLERANCE)
}
