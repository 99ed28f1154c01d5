//! The rival that has no gradient: CMA-ES.

use cmaes::{CMAESOptions, DVector};
use std::cell::RefCell;

/// The best point that it finds from `start` with about `most` values of `cost`, and how many it took: whole generations.
pub fn search(
    start: &[f64],
    spread: f64,
    most: usize,
    cost: impl Fn(&[f64]) -> f64,
) -> (Vec<f64>, usize) {
    let best = RefCell::new((f64::INFINITY, start.to_vec(), 0));
    let told = |x: &DVector<f64>| {
        let value = cost(x.as_slice());
        let mut best = best.borrow_mut();
        best.2 += 1;
        if value < best.0 {
            (best.0, best.1) = (value, x.as_slice().to_vec());
        }
        value
    };
    let search = CMAESOptions::new(start.to_vec(), spread)
        .seed(1)
        .build(told);
    if let Ok(mut search) = search {
        while search.function_evals() < most && search.next().is_none() {}
    }
    let (_, point, made) = best.into_inner();
    (point, made)
}
