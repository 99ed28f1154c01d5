//! What one step of a simulator leaves behind.

use super::{Cotangents, Gradient, Jacobians, Rollout};
use crate::{Error, Result};
use nalgebra::DVector;

/// What one step of a simulator leaves behind: the key to its derivatives, those of its controller included.
pub struct Record(Rollout);

impl Record {
    pub(super) fn new(step: Rollout) -> Self {
        Self(step)
    }

    /// The step as a rollout of one: what was observed before and after it.
    pub fn rollout(&self) -> &Rollout {
        &self.0
    }

    /// Cotangents of the right sizes, all zero: columns are the states before and after the step.
    pub fn zero_cotangents(&self) -> Cotangents {
        self.0.zero_cotangents()
    }

    /// Transpose of the step: the gradient of Σ cotangent · observation.
    ///
    /// # Errors
    /// As [`Rollout::vjp`].
    pub fn vjp(&self, cotangents: &Cotangents) -> Result<Gradient> {
        self.0.vjp(cotangents)
    }

    /// A and B of x₁ ≈ A x₀ + B u in x = (q, v), the coordinates in their tangent space: A 2nv × 2nv, B 2nv × controls.
    ///
    /// # Errors
    /// As [`Record::vjp`].
    pub fn jacobians(&self) -> Result<Jacobians> {
        self.0.jacobians()
    }

    /// Tangent of the step, A δx₀ + B δu, along a displacement of x₀ = (q, v) (2nv, the coordinates in their tangent space) and of
    /// the controls. It takes [`Record::jacobians`]: for several displacements of one step, take those.
    ///
    /// # Errors
    /// Wrong lengths, or as [`Record::jacobians`].
    pub fn jvp(&self, state: &DVector<f64>, control: &DVector<f64>) -> Result<DVector<f64>> {
        let system = self.0.simulator().system();
        let sizes = [state.len(), control.len()];
        let right = [2 * system.tree.velocities(), system.controls];
        if sizes != right {
            return Err(Error::input(
                "jvp: lengths of the displacements of state and controls",
                format!("{sizes:?}"),
                format!("must be {right:?}"),
            ));
        }
        let all = self.jacobians()?;
        Ok(all.state * state + all.controls * control)
    }
}
