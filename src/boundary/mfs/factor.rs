//! Thin QR factorisation of one body's flux matrix, deterministic and sequential.

use crate::solver::{self, largest_eigenvalue};
use faer::linalg::solvers::SolveLstsq;
use faer::linalg::triangular_solve;
use faer::{Mat, MatMut, MatRef, Par};

/// Above this condition number an undamped solution means nothing.
const SINGULAR: f64 = 1e12;
/// Damping that makes it one.
const LEAST: f64 = 1e-10;

pub(crate) struct Factored {
    /// Upper triangular, sources × sources.
    pub r: Mat<f64>,
    /// Solution, sources × columns.
    pub solution: Mat<f64>,
    /// Condition number of R with columns scaled to unit length (estimated from below).
    pub condition: f64,
    /// Diagonal of the damping rows.
    pub damping: Vec<f64>,
    /// Whether damping was needed but not asked for.
    pub singular: bool,
}

/// Least-squares solution of `[k; D] x = [rhs; 0]` by Householder QR, D = `damping` times the norms
/// of k's columns.
pub(crate) fn solve(k: MatRef<f64>, rhs: MatRef<f64>, damping: f64) -> Factored {
    if damping > 0.0 {
        return damped(k, rhs, damping);
    }
    let plain = attempt(k, rhs);
    if plain.condition < SINGULAR {
        return plain;
    }
    Factored {
        singular: true,
        condition: plain.condition,
        ..damped(k, rhs, LEAST)
    }
}

fn damped(k: MatRef<f64>, rhs: MatRef<f64>, damping: f64) -> Factored {
    let (m, n) = k.shape();
    let diagonal: Vec<f64> = (0..n).map(|j| damping * k.col(j).norm_l2()).collect();
    let mut tall = Mat::zeros(m + n, n);
    tall.subrows_mut(0, m).copy_from(k);
    for (j, d) in diagonal.iter().enumerate() {
        tall[(m + j, j)] = *d;
    }
    let mut long = Mat::zeros(m + n, rhs.ncols());
    long.subrows_mut(0, m).copy_from(rhs);
    Factored {
        damping: diagonal,
        ..attempt(tall.as_ref(), long.as_ref())
    }
}

fn attempt(k: MatRef<f64>, rhs: MatRef<f64>) -> Factored {
    let qr = k.qr();
    let r = qr.thin_R();
    Factored {
        condition: condition(r),
        solution: qr.solve_lstsq(rhs),
        r: r.to_owned(),
        damping: vec![0.0; k.ncols()],
        singular: false,
    }
}

/// x ← R⁻¹ x.
pub(crate) fn solve_upper(r: MatRef<f64>, x: MatMut<f64>) {
    triangular_solve::solve_upper_triangular_in_place(r, x, Par::Seq);
}

/// x ← R⁻ᵀ x.
pub(crate) fn solve_upper_transpose(r: MatRef<f64>, x: MatMut<f64>) {
    triangular_solve::solve_lower_triangular_in_place(r.transpose(), x, Par::Seq);
}

/// Condition number σmax/σmin of R D⁻¹, D its column norms.
fn condition(r: MatRef<f64>) -> f64 {
    let n = r.ncols();
    let mut scaled = r.to_owned();
    for j in 0..n {
        let norm = r.col(j).norm_l2();
        if norm.is_nan() || norm <= 0.0 || r[(j, j)] == 0.0 {
            return f64::INFINITY;
        }
        for i in 0..=j {
            scaled[(i, j)] /= norm;
        }
    }
    let scaled = scaled.as_ref();
    let largest = largest_eigenvalue(n, |x| {
        let mut out = x.clone();
        let product = scaled.transpose() * (scaled * x.as_mat());
        out.as_mat_mut().copy_from(product);
        out
    });
    let inverse = largest_eigenvalue(n, |x| {
        let mut out = x.clone();
        solve_upper_transpose(scaled, out.as_mat_mut());
        solve_upper(scaled, out.as_mat_mut());
        out
    });
    solver::condition(largest, inverse)
}
