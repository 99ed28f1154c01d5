//! Open-loop controls of a rollout.

use super::Simulator;
use crate::{Error, Result};
use nalgebra::DMatrix;

/// Most steps of one rollout: some kilobytes are kept for each.
pub(super) const MOST_STEPS: usize = 5_000_000;

/// One row per control, one column per step: generalised forces of actuated joints (N, N m) and wrenches of
/// bodies (N, N m; world axes, about the body's origin), in the order of the bodies, then commands of thrusters in the order of the forces
/// ([`crate::Scene::control_labels`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Controls(DMatrix<f64>);

impl Controls {
    /// No control for `steps` steps. More of them than a rollout takes are cut to one more than that, which it refuses.
    pub fn zeros(simulator: &Simulator, steps: usize) -> Self {
        let steps = steps.min(MOST_STEPS + 1);
        Self(DMatrix::zeros(simulator.system().controls, steps))
    }

    /// From a matrix, controls × steps.
    ///
    /// # Errors
    /// A number of rows other than the simulator's, or a value that isn't finite.
    pub fn from_matrix(simulator: &Simulator, matrix: DMatrix<f64>) -> Result<Self> {
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
