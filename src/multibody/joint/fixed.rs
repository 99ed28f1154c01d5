//! No motion.

use super::JointMotion;
use crate::adjoint::lie::{Pose, Vec6};

#[derive(Debug)]
pub(super) struct Fixed;

impl JointMotion for Fixed {
    fn kind(&self) -> &'static str {
        "fixed"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &[]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &[]
    }

    fn basis(&self) -> Vec<Vec6> {
        Vec::new()
    }

    fn pose(&self, _: &[f64]) -> Pose {
        Pose::identity()
    }
}
