//! What is observed at a state of a trajectory.

use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::CouplingReport;
use crate::dynamics::Parameters;
use crate::dynamics::force::Place;
use nalgebra::DVector;

/// What is observed at one state.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Time, s.
    pub time: f64,
    /// Joint coordinates.
    pub q: DVector<f64>,
    /// Generalised velocity.
    pub v: DVector<f64>,
    /// Poses of the bodies.
    pub poses: Vec<Pose>,
    /// Kinetic energy of bodies and fluid, J.
    pub kinetic_energy: f64,
    /// Potential energy of weight, buoyancy, springs, joints and tendons (those at the control 0), J.
    pub potential_energy: f64,
    /// Total momentum and angular momentum about the world origin, bodies and fluid.
    pub momentum: Vec6,
    /// Largest absolute entry of any single body's momentum.
    pub largest_momentum: Vec6,
    /// Generalised momentum along each motion in which nothing outside acts ([`Simulator::kept`](crate::Simulator::kept)).
    pub kept_momentum: DVector<f64>,
    /// Total controls during the step that starts here; empty at the last state.
    pub control: DVector<f64>,
    /// Joints held during that step.
    pub hold: Vec<bool>,
    /// What the coupling reports.
    pub report: CouplingReport,
}

impl Sample {
    /// Where bodies and joints are, as forces see them.
    pub(super) fn place<'s>(&'s self, parameters: &'s Parameters) -> Place<'s> {
        Place {
            poses: &self.poses,
            q: &self.q,
            time: self.time,
            parameters,
        }
    }

    /// Kinetic and potential energy, J.
    pub fn energy(&self) -> f64 {
        self.kinetic_energy + self.potential_energy
    }
}
