//! Rotation about the frame's origin.

use super::JointMotion;
use super::model::quaternion;
use crate::adjoint::lie::{Pose, Vec3, Vec6};

#[derive(Debug)]
pub(super) struct Spherical;

impl JointMotion for Spherical {
    fn kind(&self) -> &'static str {
        "spherical"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &["qw", "qx", "qy", "qz"]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &["wx", "wy", "wz"]
    }

    fn basis(&self) -> Vec<Vec6> {
        (3..6).map(|k| Vec6::ith(k, 1.0)).collect()
    }

    fn pose(&self, q: &[f64]) -> Pose {
        Pose::new(
            quaternion(q).to_rotation_matrix().into_inner(),
            Vec3::zeros(),
        )
    }

    fn quaternion_at(&self) -> Option<usize> {
        Some(0)
    }
}
