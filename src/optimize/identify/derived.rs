//! Residuals that are functions of observables, and their derivatives.

use crate::simulate::Rollout;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::{Arc, OnceLock};

/// Residuals as a function of observables, entries × states each: differences over deviations.
pub(super) type Function = dyn Fn(&[DMatrix<f64>]) -> Result<DVector<f64>> + Send + Sync;

/// Residuals that aren't entries of observables themselves.
#[derive(Clone)]
pub(super) struct Derived {
    pub observables: Vec<String>,
    pub states: Vec<usize>,
    function: Arc<Function>,
    /// Number of residuals, once it is known.
    count: Arc<OnceLock<usize>>,
}

impl Derived {
    pub fn new(observables: Vec<String>, states: Vec<usize>, function: Arc<Function>) -> Self {
        Self {
            observables,
            states,
            function,
            count: Arc::default(),
        }
    }

    /// What the function sees of a rollout.
    pub fn seen(&self, rollout: &Rollout) -> Result<Vec<DMatrix<f64>>> {
        let each = self.observables.iter();
        each.map(|name| Ok(rollout.observe(name)?.select_columns(&self.states)))
            .collect()
    }

    /// Number of residuals, once they have been asked for.
    pub fn residuals(&self) -> usize {
        self.count.get().copied().unwrap_or(0)
    }

    /// Residuals.
    pub fn value(&self, seen: &[DMatrix<f64>]) -> Result<DVector<f64>> {
        let found = (self.function)(seen)?;
        let count = *self.count.get_or_init(|| found.len());
        if found.len() != count || count == 0 {
            return Err(Error::input(
                format!("function of {:?}", self.observables),
                format!("{} residuals", found.len()),
                match count {
                    0 => "must give at least one".to_string(),
                    count => format!("must give as many as before, {count}"),
                },
            ));
        }
        match found.iter().position(|x| !x.is_finite()) {
            None => Ok(found),
            Some(i) => Err(Error::input(
                format!("residual {i} of a function of {:?}", self.observables),
                found[i],
                "must be finite",
            )),
        }
    }
}

/// Size of the differences by which functions of observables are differentiated, relative: their error is its square.
const DIFFERENCE: f64 = 1e-5;

/// Entries below this count as so large there: they may be zero.
const LEAST: f64 = 1e-3;
/// So do those below this part of their observable's largest, beside which smaller differences would be lost to rounding.
const LEAST_PART: f64 = 1e-6;

/// Derivative of residuals along tangents of what they are a function of, an observable after the other: they have units of their own.
pub(super) fn derivative(
    of: &Derived,
    seen: &[DMatrix<f64>],
    along: &[DMatrix<f64>],
) -> Result<DVector<f64>> {
    let mut out = DVector::zeros(of.residuals());
    for (i, tangent) in along.iter().enumerate() {
        if let Some(h) = difference(&seen[i], tangent) {
            let moved = |h: f64| {
                let mut each = seen.to_vec();
                each[i] += h * tangent;
                of.value(&each)
            };
            out += (moved(h)? - moved(-h)?) / (2.0 * h);
        }
    }
    Ok(out)
}

/// Step along a tangent of an observable, entries × states, that moves no entry by more than a small part of its size; none where nothing moves.
fn difference(seen: &DMatrix<f64>, tangent: &DMatrix<f64>) -> Option<f64> {
    let least = LEAST.max(LEAST_PART * seen.amax());
    let rows = seen.row_iter().zip(tangent.row_iter());
    let each = rows.filter_map(|(x, d)| {
        let moves = d.amax();
        (moves > 0.0).then(|| DIFFERENCE * x.amax().max(least) / moves)
    });
    // Next to no tangent would make it infinite.
    each.reduce(f64::min).map(|h| h.min(f64::MAX.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A height of 10⁵ m beside a small distance of the same observable, and an angle of another: each is differentiated by steps of its own size.
    #[test]
    fn large_observables_leave_small_ones_their_steps() {
        let function = |seen: &[DMatrix<f64>]| {
            let [x, z, angle] = [seen[0][(0, 0)], seen[0][(1, 0)], seen[1][(0, 0)]];
            Ok(DVector::from_vec(vec![x.sin(), 1e-5 * z, angle.sin()]))
        };
        let names = vec!["positions".into(), "attitudes".into()];
        let of = Derived::new(names, vec![0], Arc::new(function));
        let seen = [
            DMatrix::from_vec(2, 1, vec![0.1, 1e5]),
            DMatrix::from_element(1, 1, 0.3),
        ];
        of.value(&seen).unwrap();
        let along = |by: f64| {
            [
                DMatrix::from_vec(2, 1, vec![2.0 * by, 1.0 * by]),
                DMatrix::from_element(1, 1, 3.0 * by),
            ]
        };
        for by in [1.0, 1e-9] {
            let found = derivative(&of, &seen, &along(by)).unwrap() / by;
            let right = [2.0 * 0.1_f64.cos(), 1e-5, 3.0 * 0.3_f64.cos()];
            for (found, right) in found.iter().zip(right) {
                assert!((found / right - 1.0).abs() < 1e-4, "{found} {right}");
            }
        }
        let none = derivative(&of, &seen, &along(0.0)).unwrap();
        assert_eq!(none, DVector::zeros(3));
    }
}
