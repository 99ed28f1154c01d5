//! Rotation about an axis through the frame's origin.

use super::{Axis, JointMotion, Refused};
use crate::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix, six};

#[derive(Debug)]
pub(super) struct Revolute(Axis);

impl Revolute {
    pub fn new(axis: [f64; 3]) -> Self {
        Self(Axis::new(axis))
    }
}

impl JointMotion for Revolute {
    fn kind(&self) -> &'static str {
        "revolute"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &["angle"]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &["rate"]
    }

    fn basis(&self) -> Vec<Vec6> {
        vec![six(&Vec3::zeros(), &self.0.unit)]
    }

    fn pose(&self, q: &[f64]) -> Pose {
        Pose::new(exp_matrix(&(q[0] * self.0.unit)), Vec3::zeros())
    }

    fn refused(&self) -> Option<Refused> {
        self.0.refused()
    }
}
