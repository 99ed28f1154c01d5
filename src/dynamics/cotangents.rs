//! What a transpose of forces or momenta yields.

use super::{Evaluation, Parameters};
use nalgebra::DVector;

/// Cotangents of configuration, velocity, control and parameters.
#[derive(Clone, Debug)]
pub struct ForceCotangents {
    /// Tangent cotangent of q.
    pub q: DVector<f64>,
    /// Cotangent of v.
    pub v: DVector<f64>,
    /// Cotangent of the controls.
    pub control: DVector<f64>,
    /// Cotangents of the parameters.
    pub parameters: Parameters,
}

impl ForceCotangents {
    /// All zero.
    pub fn zeros(e: &Evaluation) -> Self {
        let nv = e.system.tree.velocities();
        Self {
            q: DVector::zeros(nv),
            v: DVector::zeros(nv),
            control: DVector::zeros(e.system.controls),
            parameters: e.parameters.zeros(),
        }
    }
}
