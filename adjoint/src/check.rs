//! Checks of derivatives: central differences, order of the Taylor remainder, dot products.
//!
//! A check that only asks for a small error passes on a wrong derivative of a small quantity; the
//! remainder `f(x + h dx) − f(x) − h J dx` of a right one also *shrinks like h²*. Both are asked.

/// Step sizes at which [`outcome`] takes central differences; the best one counts, or the first that is good enough.
pub const STEPS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// One registered rung of the ladder and its check.
pub struct Rung {
    /// Path and name, as in `kernel::flux::flux_vjp`.
    pub name: &'static str,
    /// Runs the check on the rung's output times `corruption`: 1 is the rung itself, 1.01 is one
    /// that is 1 % wrong and must fail.
    pub check: fn(corruption: f64) -> Outcome,
}

/// Result of a gradient check.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Relative error against the best central difference.
    pub rel_error: f64,
    /// Order of the Taylor remainder, 2 for a right first derivative (infinite where the function
    /// is linear to round-off).
    pub order: f64,
    /// Largest accepted `rel_error`.
    pub tolerance: f64,
}

impl Outcome {
    /// Small error and second order.
    pub fn passes(&self) -> bool {
        self.rel_error <= self.tolerance && self.order > 1.8
    }

    /// The larger error, the larger tolerance and the lower order of two checks of one rung.
    pub fn worst(self, other: Self) -> Self {
        Self {
            rel_error: self.rel_error.max(other.rel_error),
            order: if self.order.is_nan() || self.order < other.order {
                self.order
            } else {
                other.order
            },
            tolerance: self.tolerance.max(other.tolerance),
        }
    }
}

/// Euclidean norm.
pub fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// Inner product.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(a, b)| a * b).sum()
}

/// `x + h dx`.
pub fn moved(x: &[f64], h: f64, dx: &[f64]) -> Vec<f64> {
    assert_eq!(x.len(), dx.len());
    x.iter().zip(dx).map(|(a, b)| a + h * b).collect()
}

/// Relative errors `‖(f(x + h dx) − f(x − h dx))/2h − jvp‖ / ‖difference‖`, one per step `h`.
/// A right derivative's error falls like h² until round-off takes over.
pub fn central_difference(
    f: impl Fn(&[f64]) -> Vec<f64>,
    x: &[f64],
    dx: &[f64],
    jvp: &[f64],
    steps: &[f64],
) -> Vec<f64> {
    steps
        .iter()
        .map(|&h| {
            let (ahead, behind) = (f(&moved(x, h, dx)), f(&moved(x, -h, dx)));
            let difference: Vec<f64> = ahead
                .iter()
                .zip(&behind)
                .map(|(a, b)| (a - b) / (2.0 * h))
                .collect();
            norm(&moved(&difference, -1.0, jvp)) / norm(&difference).max(f64::MIN_POSITIVE)
        })
        .collect()
}

/// Smallest relative error over [`STEPS`], or the first that `tolerance` accepts: the others needn't be known.
pub fn smallest_error(
    f: impl Fn(&[f64]) -> Vec<f64>,
    x: &[f64],
    dx: &[f64],
    jvp: &[f64],
    tolerance: f64,
) -> f64 {
    let mut smallest = f64::INFINITY;
    // From the middle on: the best ones are seldom at an end.
    for h in [STEPS[2], STEPS[1], STEPS[3], STEPS[0]] {
        let error = central_difference(&f, x, dx, jvp, &[h])[0];
        smallest = smallest.min(error);
        if smallest <= tolerance {
            break;
        }
    }
    smallest
}

/// Order of the remainder `‖f(x + h dx) − f(x) − h jvp‖` in h, from the two smallest of the steps
/// 1/64, 1/128, … whose remainder stands clear of round-off. Choose `dx` so that a step of 1/64 is
/// small to `f`. Infinite if no two remainders stand clear (`f` is linear).
pub fn taylor_order(f: impl Fn(&[f64]) -> Vec<f64>, x: &[f64], dx: &[f64], jvp: &[f64]) -> f64 {
    let start = f(x);
    let round_off = 1e-11 * norm(&start).max(norm(jvp)).max(f64::MIN_POSITIVE);
    let mut known = [None; 20];
    let mut remainder = |i: usize| {
        *known[i].get_or_insert_with(|| {
            let h = 0.5_f64.powi(i as i32);
            let linear = moved(&start, h, jvp);
            norm(&moved(&f(&moved(x, h, dx)), -1.0, &linear))
        })
    };
    if remainder(6) < round_off {
        return f64::INFINITY;
    }
    // Remainders shrink: the last one that stands clear is found by halves.
    let (mut clear, mut end) = (6, 20);
    while end - clear > 1 {
        let middle = (clear + end) / 2;
        if remainder(middle) < round_off {
            end = middle;
        } else {
            clear = middle;
        }
    }
    if clear == 6 {
        return f64::INFINITY;
    }
    (remainder(clear - 1) / remainder(clear)).log2()
}

/// Gap of `⟨J dx, ȳ⟩ = ⟨dx, Jᵀ ȳ⟩`, relative to `‖J dx‖ ‖ȳ‖`; round-off if the two rungs agree.
pub fn dot_product_gap(jvp_dx: &[f64], y_bar: &[f64], dx: &[f64], vjp_y_bar: &[f64]) -> f64 {
    (dot(jvp_dx, y_bar) - dot(dx, vjp_y_bar)).abs()
        / (norm(jvp_dx) * norm(y_bar)).max(f64::MIN_POSITIVE)
}

/// Both checks of a directional derivative `jvp = J dx` of `f` at `x`.
pub fn outcome(
    f: impl Fn(&[f64]) -> Vec<f64>,
    x: &[f64],
    dx: &[f64],
    jvp: &[f64],
    tolerance: f64,
) -> Outcome {
    let rel_error = smallest_error(&f, x, dx, jvp, tolerance);
    Outcome {
        rel_error,
        order: taylor_order(f, x, dx, jvp),
        tolerance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn f(x: &[f64]) -> Vec<f64> {
        vec![x[0].sin() * x[1], x[0] * x[0] + x[1].exp()]
    }

    #[test]
    fn right_derivatives_pass_and_wrong_ones_fail() {
        let (x, dx) = ([0.4_f64, 0.7_f64], [1.0, -0.5]);
        let jvp = |factor: f64| {
            vec![
                factor * (x[0].cos() * x[1] * dx[0] + x[0].sin() * dx[1]),
                factor * (2.0 * x[0] * dx[0] + x[1].exp() * dx[1]),
            ]
        };
        let right = outcome(f, &x, &dx, &jvp(1.0), 1e-8);
        assert!(
            right.passes() && (right.order - 2.0).abs() < 0.1,
            "{right:?}"
        );
        let wrong = outcome(f, &x, &dx, &jvp(1.01), 1e-8);
        assert!(!wrong.passes() && wrong.order < 1.2, "{wrong:?}");
        let linear = outcome(|x| vec![2.0 * x[0]], &x, &dx, &[2.0], 1e-8);
        assert!(linear.passes(), "{linear:?}");
    }

    #[test]
    fn dot_products_of_a_transpose_agree() {
        // J = [1 2; 3 4], dx = (1, 1), ȳ = (1, −1).
        assert!(dot_product_gap(&[3.0, 7.0], &[1.0, -1.0], &[1.0, 1.0], &[-2.0, -2.0]) < 1e-15);
        assert!(dot_product_gap(&[3.0, 7.0], &[1.0, -1.0], &[1.0, 1.0], &[-2.0, -2.1]) > 1e-3);
    }
}
