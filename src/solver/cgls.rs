//! Conjugate gradients on the normal equations, right-preconditioned (Eq. 20).

use super::{CALLS, Columns};

/// What an iteration reached.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Solution.
    pub x: Columns,
    /// Iterations of the slowest column.
    pub iterations: usize,
    /// Largest relative preconditioned residual over the columns.
    pub residual: f64,
}

/// Solves `KᵀK x = g` for several columns with the right preconditioner R:
/// conjugate gradients on `R⁻ᵀ KᵀK R⁻¹ y = R⁻ᵀ g`, `x = R⁻¹ y`, until
/// `‖R⁻ᵀ(g − KᵀK x)‖ ≤ tolerance · ‖R⁻ᵀ g‖` in every column.
///
/// `normal` applies KᵀK, `precondition` R⁻¹ and `precondition_transpose` R⁻ᵀ in place. A column
/// of zeros has the solution zero, at no iteration.
///
/// # References
/// Björck, Numerical Methods for Least Squares Problems (1996), §7.4 (CGLS); Hestenes and Stiefel
/// (1952).
pub fn cgls(
    normal: impl Fn(&Columns) -> Columns,
    precondition: impl Fn(&mut Columns),
    precondition_transpose: impl Fn(&mut Columns),
    g: &Columns,
    tolerance: f64,
    max_iterations: usize,
) -> Outcome {
    let limits = (tolerance, max_iterations);
    cgls_watched(
        normal,
        precondition,
        precondition_transpose,
        g,
        limits,
        |_, _| true,
    )
}

/// As [`cgls`] to a tolerance in at most so many iterations; `watch` sees the iteration and its x after each, and says whether to go on.
pub fn cgls_watched(
    normal: impl Fn(&Columns) -> Columns,
    precondition: impl Fn(&mut Columns),
    precondition_transpose: impl Fn(&mut Columns),
    g: &Columns,
    (tolerance, max_iterations): (f64, usize),
    mut watch: impl FnMut(usize, &Columns) -> bool,
) -> Outcome {
    CALLS.add(1);
    let n = g.columns;
    let mut x = Columns::zeros(g.rows, n);
    let mut s = g.clone();
    precondition_transpose(&mut s);
    let start = s.dots(&s);
    let mut gamma = start.clone();
    let mut p = s.clone();
    let mut active: Vec<bool> = start.iter().map(|g| *g > 0.0 && g.is_finite()).collect();
    let mut iterations = 0;
    while iterations < max_iterations && active.iter().any(|a| *a) {
        iterations += 1;
        let mut direction = p.clone();
        precondition(&mut direction);
        let mut q = normal(&direction);
        precondition_transpose(&mut q);
        let curvature = p.dots(&q);
        let mut alpha = vec![0.0; n];
        for k in 0..n {
            active[k] &= curvature[k] > 0.0;
            if active[k] {
                alpha[k] = gamma[k] / curvature[k];
            }
        }
        x.add_scaled(&direction, &alpha);
        s.add_scaled(&q, &alpha.iter().map(|a| -a).collect::<Vec<_>>());
        let next = s.dots(&s);
        let mut beta = vec![0.0; n];
        for k in 0..n {
            if active[k] {
                beta[k] = next[k] / gamma[k];
                gamma[k] = next[k];
                if next[k].sqrt() <= tolerance * start[k].sqrt() {
                    active[k] = false;
                }
            }
        }
        for (at, (p, s)) in p.data.iter_mut().zip(&s.data).enumerate() {
            let k = at % n;
            *p = if active[k] { s + beta[k] * *p } else { 0.0 };
        }
        if !watch(iterations, &x) {
            break;
        }
    }
    let relative = |k: usize| {
        if start[k] == 0.0 {
            return 0.0;
        }
        // Infinite where a right-hand side or an iterate isn't finite.
        let ratio = (gamma[k] / start[k]).sqrt();
        if ratio.is_nan() { f64::INFINITY } else { ratio }
    };
    Outcome {
        x,
        iterations,
        residual: (0..n).map(relative).fold(0.0, f64::max),
    }
}
