//! Contact of many bodies while what they exchange through the water stays as it is: which corners press, and which slide, is found without a product of theirs.

use super::hessian::Hessian;
use super::line::{Step, Trial, Try, search};
use super::reaction::Reaction;
use super::split::Split;
use crate::Result;
use nalgebra::DVector;

/// Most steps.
const STEPS: usize = 40;
/// Part of the imbalance that may be left.
const LEFT: f64 = 0.01;

/// The velocity at which contact would be balanced.
pub(super) fn solve<'a>(
    now: &Trial,
    hessian: &mut dyn FnMut(&DVector<f64>) -> Result<Hessian<'a>>,
    (split, reaction, dt): (&Split, &Reaction, f64),
    at: &Try,
) -> Result<DVector<f64>> {
    let mut trial = Trial {
        behind: Vec::new(),
        ..now.clone()
    };
    for _ in 0..STEPS {
        let alone = hessian(&trial.v)?.alone(&split.take(&trial.imbalance));
        let v = split.put(&alone);
        // That with the bodies' own inertia.
        let moved = Some(&trial.imbalance + dt * reaction.force_jvp(&trial.v, &v));
        let step = Step {
            v,
            moved,
            left: Vec::new(),
        };
        trial = search(&trial, &step, at);
        if trial.residual.is_nan() || trial.residual <= LEFT * now.residual {
            break;
        }
    }
    Ok(trial.v)
}
