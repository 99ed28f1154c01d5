//! The search along a step of Newton's method for contact.

use nalgebra::DVector;
use std::iter::repeat;

/// Evaluations of a search along a step.
const TRIALS: usize = 60;
/// Part of the slope at its start that a search may leave.
const LEFT: f64 = 0.3;

/// A velocity with its imbalance M (v − v*) − Δt g.
#[derive(Clone)]
pub(super) struct Trial {
    pub v: DVector<f64>,
    /// M (v − v*).
    pub moved: DVector<f64>,
    /// What the water's own equations lack of that where M v is a solve of theirs, in units of about the root of an energy; else nothing.
    pub behind: Vec<f64>,
    pub imbalance: DVector<f64>,
    /// Whether more than of the balance itself.
    pub lacks: bool,
    pub residual: f64,
}

/// A step of the search.
pub(super) struct Step {
    pub v: DVector<f64>,
    /// Its product with M, where that isn't found by multiplying.
    pub moved: Option<DVector<f64>>,
    /// What it leaves of the water's own equations.
    pub left: Vec<f64>,
}

/// A velocity to try, from its product with M where that is known, and what lacks of it.
pub(super) type Try<'t> = dyn Fn(DVector<f64>, Option<DVector<f64>>, Vec<f64>) -> Trial + 't;

/// Along Newton's step: the full one, or where that runs past the least value on its way, about there (regula falsi on the
/// slope, in halves where it creeps). Short of it won't do: where the slope turns steeply, regula falsi's first guess is hardly a step.
pub(super) fn search(now: &Trial, step: &Step, at: &Try) -> Trial {
    let after = |length: f64| {
        let moved = (step.moved.as_ref()).map(|moved| &now.moved - length * moved);
        // Lacking nothing is the same as zeros.
        let lacked = now.behind.iter().copied().chain(repeat(0.0));
        let behind = (step.left.iter().zip(lacked))
            .map(|(left, lacked)| (1.0 - length) * lacked + length * left);
        at(&now.v - length * &step.v, moved, behind.collect())
    };
    let slope = |t: &Trial| t.imbalance.dot(&step.v);
    let start = slope(now);
    let mut best = after(1.0);
    let (mut low, mut high) = ((0.0, start), (1.0, slope(&best)));
    // Where more is left of the water's equations than of the balance, the slope tells nothing.
    if now.lacks || high.1 >= -LEFT * start || start.is_nan() || start <= 0.0 {
        return best;
    }
    for trial in 0..TRIALS {
        let length = match trial % 2 {
            0 => (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1),
            _ => 0.5 * (low.0 + high.0),
        };
        let next = after(length);
        let there = slope(&next);
        match there < 0.0 {
            true => high = (length, there),
            false => low = (length, there),
        }
        best = next;
        if there.abs() <= LEFT * start {
            break;
        }
    }
    best
}
