//! CMA-ES, by the crate `cmaes`, until something is caught.

use super::tried::Tried;
use crate::{Error, Result};
use cmaes::{CMAESOptions, DVector};
use std::cell::{Cell, RefCell};

/// How far it searches at first, in the units of knots.
const SPREAD: f64 = 0.3;
/// Cost of a simulation that fails.
const FAILED: f64 = 1e9;

/// The best point that was seen in at most `most` evaluations, none if all failed. Ends with the first one that is caught.
pub(super) fn search(
    evaluate: impl Fn(&[f64]) -> Option<Tried>,
    start: &[f64],
    most: usize,
    seed: u64,
) -> Result<Option<Tried>> {
    let best: RefCell<Option<Tried>> = RefCell::new(None);
    let (caught, count) = (Cell::new(false), Cell::new(0));
    let cost = |x: &DVector<f64>| {
        if caught.get() || count.get() == most {
            return FAILED;
        }
        count.set(count.get() + 1);
        let Some(tried) = evaluate(x.as_slice()) else {
            return FAILED;
        };
        let cost = tried.cost;
        caught.set(tried.caught);
        let mut best = best.borrow_mut();
        if best.as_ref().is_none_or(|b| tried.better(b)) {
            *best = Some(tried);
        }
        cost
    };
    let options = CMAESOptions::new(start.to_vec(), SPREAD).seed(seed);
    let mut state = options.build(cost).map_err(|e| Error::Solver {
        what: "evolution strategy".into(),
        iterations: 0,
        residual: f64::NAN,
        tolerance: 0.0,
        remedy: format!("{e:?}"),
    })?;
    while !caught.get() && count.get() < most {
        if state.next().is_some() {
            break;
        }
    }
    drop(state);
    Ok(best.into_inner())
}
