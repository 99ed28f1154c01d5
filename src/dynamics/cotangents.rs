//! What a transpose of forces or momenta yields.

use super::force::LoadBars;
use super::{Evaluation, Parameters};
use crate::multibody::Cotangents;
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

    /// Where forces add theirs, with those of the bodies' poses and twists.
    pub(super) fn bars<'b>(&'b mut self, bodies: &'b mut Cotangents) -> LoadBars<'b> {
        LoadBars {
            pose: &mut bodies.pose,
            twist: &mut bodies.twist,
            ..self.joint_bars()
        }
    }

    /// Where forces add theirs that act on joints alone.
    pub(super) fn joint_bars(&mut self) -> LoadBars<'_> {
        LoadBars {
            pose: &mut [],
            twist: &mut [],
            q: &mut self.q,
            v: &mut self.v,
            control: &mut self.control,
            parameters: &mut self.parameters,
        }
    }
}
