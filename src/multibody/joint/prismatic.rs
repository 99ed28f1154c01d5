//! Translation along an axis.

use super::{Axis, JointMotion, Refused};
use crate::adjoint::lie::{Mat3, Pose, Vec3, Vec6, six};

#[derive(Debug)]
pub(super) struct Prismatic(Axis);

impl Prismatic {
    pub fn new(axis: [f64; 3]) -> Self {
        Self(Axis::new(axis))
    }
}

impl JointMotion for Prismatic {
    fn kind(&self) -> &'static str {
        "prismatic"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &["position"]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &["velocity"]
    }

    fn basis(&self) -> Vec<Vec6> {
        vec![six(&self.0.unit, &Vec3::zeros())]
    }

    fn pose(&self, q: &[f64]) -> Pose {
        Pose::new(Mat3::identity(), q[0] * self.0.unit)
    }

    fn refused(&self) -> Option<Refused> {
        self.0.refused()
    }
}
