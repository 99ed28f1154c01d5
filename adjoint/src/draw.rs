//! What the checks of this crate draw.

use crate::sample;
#[cfg(test)]
use std::cell::RefCell;

#[cfg(test)]
thread_local! {
    /// What the checks of this thread drew.
    pub(crate) static DRAWN: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// Numbers between −`size` and `size` of which all checks are made.
pub(crate) fn numbers(seed: u64, count: usize, size: f64) -> Vec<f64> {
    let drawn = sample::numbers(seed, count, size);
    #[cfg(test)]
    DRAWN.with_borrow_mut(|all| all.push(drawn.clone()));
    drawn
}
