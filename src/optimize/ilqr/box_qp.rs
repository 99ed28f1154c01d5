//! A quadratic function within a box, by projected Newton steps.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Most Newton steps: each settles which entries stand at a bound, and a handful do.
const STEPS: usize = 100;
/// Most halvings of one.
const HALVINGS: i32 = 40;
/// Part of the decrease that its slope promises.
const ARMIJO: f64 = 0.1;
/// Ends once a step promises less than this part of what the first one did.
const SMALL: f64 = 1e-24;

/// The least point, and what it takes to move it.
pub(super) struct BoxQp {
    pub x: DVector<f64>,
    /// Entries that no bound holds, in order.
    pub free: Vec<usize>,
    /// Factor of their part of the Hessian; none where no entry is free.
    pub factor: Option<Cholesky<f64, Dyn>>,
}

/// What is free, and the factor of H there.
type Factored = (Vec<usize>, Option<Cholesky<f64, Dyn>>);

/// Least point of ½ xᵀHx + gᵀx with lower ≤ x ≤ upper, which holds 0. None where H isn't positive definite in what is free.
///
/// M. Tassa, N. Mansard, E. Todorov, "Control-limited differential dynamic programming", ICRA 2014, section III; D. Bertsekas, "Projected Newton methods for optimization
/// problems with simple constraints", 1982.
pub(super) fn box_qp(
    h: &DMatrix<f64>,
    g: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
) -> Option<BoxQp> {
    let n = g.len();
    let project = |x: DVector<f64>| x.zip_zip_map(lower, upper, |x, a, b| x.clamp(a, b));
    let value = |x: &DVector<f64>, hx: &DVector<f64>| 0.5 * x.dot(hx) + g.dot(x);
    let mut x = project(DVector::zeros(n));
    let mut factored: Option<Factored> = None;
    let mut first = None;
    for _ in 0..STEPS {
        let hx = h * &x;
        let gradient = g + &hx;
        let is_free = |i: &usize| {
            let held_below = x[*i] <= lower[*i] && gradient[*i] > 0.0;
            let held_above = x[*i] >= upper[*i] && gradient[*i] < 0.0;
            !(held_below || held_above)
        };
        let free: Vec<usize> = (0..n).filter(is_free).collect();
        if factored.as_ref().is_none_or(|(of, _)| *of != free) {
            let factor = match free.is_empty() {
                true => None,
                false => Some(part(h, &free).cholesky()?),
            };
            factored = Some((free.clone(), factor));
        }
        let Some((_, Some(factor))) = &factored else {
            break;
        };
        let own = DVector::from_fn(free.len(), |k, _| gradient[free[k]]);
        let step = -factor.solve(&own);
        let promised = -own.dot(&step);
        if promised <= SMALL * *first.get_or_insert(promised) {
            break;
        }
        let before = value(&x, &hx);
        let along = |length: f64| {
            let mut to = x.clone();
            for (k, i) in free.iter().enumerate() {
                to[*i] += length * step[k];
            }
            project(to)
        };
        let falls = |to: &DVector<f64>| {
            let slope = gradient.dot(&(to - &x));
            value(to, &(h * to)) - before <= ARMIJO * slope && slope < 0.0
        };
        let trials = (0..HALVINGS).map(|k| along(0.5_f64.powi(k)));
        // Rounding is all that is left where none falls.
        match trials.into_iter().find(falls) {
            Some(to) => x = to,
            None => break,
        }
    }
    let (free, factor) = factored?;
    Some(BoxQp { x, free, factor })
}

/// Rows and columns of a matrix.
fn part(h: &DMatrix<f64>, of: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(of.len(), of.len(), |i, j| h[(of[i], of[j])])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjoint::sample::numbers;

    /// Against all ways to hold entries at bounds.
    #[test]
    fn the_least_point_is_that_of_all_active_sets() {
        let n = 4;
        let mut held = 0;
        for seed in 1..40 {
            let of = |salt: u64, count: usize| numbers(100 * seed + salt, count, 1.0);
            let a = DMatrix::from_vec(n, n, of(1, n * n));
            let h = a.tr_mul(&a) + 1e-3 * DMatrix::identity(n, n);
            let g = DVector::from_vec(of(2, n));
            let lower = DVector::from_vec(of(3, n)).map(|x| -x.abs());
            let upper = DVector::from_vec(of(4, n)).map(f64::abs);
            let found = box_qp(&h, &g, &lower, &upper).unwrap();
            let value = |x: &DVector<f64>| 0.5 * x.dot(&(&h * x)) + g.dot(x);
            let mut best = f64::INFINITY;
            for mut code in 0..3_usize.pow(n as u32) {
                let mut x = DVector::zeros(n);
                let mut free = Vec::new();
                for i in 0..n {
                    match code % 3 {
                        0 => free.push(i),
                        1 => x[i] = lower[i],
                        _ => x[i] = upper[i],
                    }
                    code /= 3;
                }
                if !free.is_empty() {
                    let right = &g + &h * &x;
                    let right = DVector::from_fn(free.len(), |k, _| -right[free[k]]);
                    let own = part(&h, &free).lu().solve(&right).unwrap();
                    for (k, i) in free.iter().enumerate() {
                        x[*i] = own[k];
                    }
                }
                let inside = (0..n).all(|i| x[i] >= lower[i] && x[i] <= upper[i]);
                if inside {
                    best = best.min(value(&x));
                }
            }
            held += n - found.free.len();
            assert!(
                (value(&found.x) - best).abs() <= 1e-12 * best.abs(),
                "{seed}"
            );
            for i in 0..n {
                assert!(found.x[i] >= lower[i] && found.x[i] <= upper[i]);
            }
        }
        assert!(held > 20, "{held}");
    }
}
