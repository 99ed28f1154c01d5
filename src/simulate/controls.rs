//! Open-loop controls of a rollout.

use super::Simulator;
use crate::memory;
use crate::{Error, Result};
use nalgebra::DMatrix;

/// Most steps of one rollout: some kilobytes are kept for each.
pub(super) const MOST_STEPS: usize = 5_000_000;
/// Most steps of a run of which only parts are kept: no more are waited for.
const MOST_IN_PARTS: usize = 1_000_000_000;

/// One row per control, one column per step: generalised forces of actuated joints (N, N m) and wrenches of
/// bodies (N, N m; world axes, about the body's origin), in the order of the bodies, then commands of thrusters in the order of the forces
/// ([`crate::Scene::control_labels`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Controls(DMatrix<f64>);

impl Controls {
    /// No control for `steps` steps of a rollout. More of them than a rollout takes are cut to one more than that, which it refuses; [`Controls::none`] cuts nothing.
    pub fn zeros(simulator: &Simulator, steps: usize) -> Self {
        let steps = steps.min(MOST_STEPS + 1);
        Self(DMatrix::zeros(simulator.system().controls, steps))
    }

    /// No control for `steps` steps, or an error: also for runs of which only parts are kept ([`Simulator::gradient_in_parts`]).
    ///
    /// # Errors
    /// More steps than any run takes, or than there is memory for.
    pub fn none(simulator: &Simulator, steps: usize) -> Result<Self> {
        check_steps(steps)?;
        let controls = simulator.system().controls;
        // Who runs with them has them once more, or their gradient.
        let bytes = memory::numbers(2.0 * controls as f64 * steps as f64);
        let what = format!("a run of {steps} steps with {controls} controls each");
        memory::fits(&what, bytes, "make fewer steps")?;
        Ok(Self(DMatrix::zeros(controls, steps)))
    }

    /// From a matrix, controls × steps.
    ///
    /// # Errors
    /// A number of rows other than the simulator's, more steps than any run takes, or a value that isn't finite.
    pub fn from_matrix(simulator: &Simulator, matrix: DMatrix<f64>) -> Result<Self> {
        check_steps(matrix.ncols())?;
        let expected = simulator.system().controls;
        if matrix.nrows() != expected {
            return Err(Error::input(
                "controls",
                format!("{} × {}", matrix.nrows(), matrix.ncols()),
                format!("must have {expected} rows, one per control, and a column per step"),
            ));
        }
        if let Some(at) = matrix.iter().position(|x| !x.is_finite()) {
            return Err(Error::input(
                format!(
                    "controls: row {}, step {}",
                    at % matrix.nrows(),
                    at / matrix.nrows()
                ),
                matrix[at],
                "must be finite",
            ));
        }
        Ok(Self(matrix))
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.0.ncols()
    }

    /// As a matrix, controls × steps.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.0
    }
}

/// Refuses more steps than any run takes: without controls they take no memory.
fn check_steps(steps: usize) -> Result<()> {
    match steps <= MOST_IN_PARTS {
        true => Ok(()),
        false => Err(Error::input(
            "controls: steps",
            steps,
            format!("must be at most {MOST_IN_PARTS}"),
        )),
    }
}
