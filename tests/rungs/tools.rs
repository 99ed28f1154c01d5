//! What the checks share.

use hydrograd::adjoint::check::{Outcome, outcome};
use hydrograd::adjoint::sample;
use nalgebra::DVector;
use std::cell::RefCell;

/// Largest accepted relative error.
pub const TOLERANCE: f64 = 1e-6;

thread_local! {
    /// What the checks of this thread drew.
    static DRAWN: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// Fixed numbers between −`size` and `size`, of which all checks are made.
pub fn wavy(count: usize, phase: f64, size: f64) -> DVector<f64> {
    let drawn = sample::numbers(phase.to_bits(), count, size);
    DRAWN.with_borrow_mut(|all| all.push(drawn.clone()));
    DVector::from_vec(drawn)
}

/// What `check` gives, and what it draws.
pub fn drawn_by(check: impl FnOnce() -> Outcome) -> (Outcome, Vec<Vec<f64>>) {
    DRAWN.take();
    let outcome = check();
    (outcome, DRAWN.take())
}

/// The worst of several checks.
pub fn all(outcomes: impl IntoIterator<Item = Outcome>) -> Outcome {
    outcomes
        .into_iter()
        .reduce(Outcome::worst)
        .expect("at least one check")
}

/// A scalar along a line against its slope at 0.
pub fn along(value: impl Fn(f64) -> f64, slope: f64) -> Outcome {
    outcome(|h| vec![value(h[0])], &[0.0], &[1.0], &[slope], TOLERANCE)
}

/// A vector along a line against its tangent at 0.
pub fn vector_along(value: impl Fn(f64) -> Vec<f64>, tangent: &[f64]) -> Outcome {
    outcome(|h| value(h[0]), &[0.0], &[1.0], tangent, TOLERANCE)
}

/// One group of inputs: a direction's slope by the adjoint, and the scalar along it.
pub struct Group<'a> {
    pub name: &'static str,
    pub slope: f64,
    pub value: Box<dyn Fn(f64) -> f64 + 'a>,
}

/// Checks each group on its own, so that a large one can't hide a small one. Groups that the scalar
/// doesn't depend on must have no slope.
pub fn groups(list: Vec<Group>, corruption: f64) -> Outcome {
    let largest = list.iter().map(|g| g.slope.abs()).fold(0.0, f64::max);
    let mut out = None;
    for g in list {
        let difference = ((g.value)(1e-3) - (g.value)(-1e-3)) / 2e-3;
        let start = (g.value)(0.0).abs();
        if g.slope.abs() <= 1e-12 * largest && difference.abs() <= 1e-9 * largest + 1e-10 * start {
            continue;
        }
        let one = along(&g.value, corruption * g.slope);
        if corruption == 1.0 && !one.passes() {
            println!(
                "group {}: slope {} difference {difference} {one:?}",
                g.name, g.slope
            );
        }
        // One group that fails is enough for a corrupted rung.
        if corruption != 1.0 && !one.passes() {
            return one;
        }
        out = Some(match out {
            None => one,
            Some(all) => one.worst(all),
        });
    }
    out.expect("a group that the scalar depends on")
}
