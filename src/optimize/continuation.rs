//! A descent on a family of functions, from an easy one to the one that is meant.

use super::{OptimizeProgress, OptimizeSettings, Optimum, minimise};
use crate::{Error, Result};

/// Descends the function of each of `stages` in turn, each from where the one before ended: softnesses of contact
/// ([`crate::simulate::Simulator::soften_contact`]), say, that end in 1. The result is that of the last stage, with the iterations, evaluations and failures of all;
/// a stage whose start fails is passed over, unless it is the last.
///
/// # Errors
/// No stages, or as [`minimise`] in the last stage.
pub fn continuation(
    mut function: impl FnMut(f64, &[f64]) -> Result<(f64, Vec<f64>)>,
    stages: &[f64],
    start: &[f64],
    settings: &OptimizeSettings,
    mut progress: impl FnMut(f64, &OptimizeProgress),
) -> Result<Optimum> {
    let Some((last, before)) = stages.split_last() else {
        let expected = "must be at least 1 stage";
        return Err(Error::input("continuation: stages", 0, expected));
    };
    let mut x = start.to_vec();
    let (mut iterations, mut evaluations, mut failures) = (0, 0, 0);
    for stage in before {
        let made = minimise(
            |x| function(*stage, x),
            &x,
            settings,
            |p| progress(*stage, p),
        );
        match made {
            Ok(found) => {
                iterations += found.iterations;
                evaluations += found.evaluations;
                failures += found.failures;
                x = found.x;
            }
            Err(stop @ Error::Stopped { .. }) => return Err(stop),
            Err(_) => failures += 1,
        }
    }
    let found = minimise(|x| function(*last, x), &x, settings, |p| progress(*last, p))?;
    Ok(Optimum {
        iterations: iterations + found.iterations,
        evaluations: evaluations + found.evaluations,
        failures: failures + found.failures,
        ..found
    })
}
