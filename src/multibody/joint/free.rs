//! Any rigid motion: position, then rotation.

use super::JointMotion;
use super::model::{quaternion, vec3};
use crate::adjoint::lie::{Pose, Vec6};

#[derive(Debug)]
pub(super) struct Free;

impl JointMotion for Free {
    fn kind(&self) -> &'static str {
        "free"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &["x", "y", "z", "qw", "qx", "qy", "qz"]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &["vx", "vy", "vz", "wx", "wy", "wz"]
    }

    fn basis(&self) -> Vec<Vec6> {
        (0..6).map(|k| Vec6::ith(k, 1.0)).collect()
    }

    fn pose(&self, q: &[f64]) -> Pose {
        Pose::new(
            quaternion(&q[3..7]).to_rotation_matrix().into_inner(),
            vec3(&q[0..3]),
        )
    }

    fn quaternion_at(&self) -> Option<usize> {
        Some(3)
    }

    fn has_frame_map(&self) -> bool {
        true
    }

    fn frame_velocity(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        let lin = vec3(v) + vec3(q).cross(&vec3(&v[3..6]));
        vec![lin.x, lin.y, lin.z, v[3], v[4], v[5]]
    }

    fn frame_velocity_inverse(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        let lin = vec3(hat) - vec3(q).cross(&vec3(&hat[3..6]));
        vec![lin.x, lin.y, lin.z, hat[3], hat[4], hat[5]]
    }

    fn frame_momentum_transpose(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        let ang = vec3(&hat[3..6]) - vec3(q).cross(&vec3(hat));
        vec![hat[0], hat[1], hat[2], ang.x, ang.y, ang.z]
    }

    fn frame_momentum(&self, q: &[f64], p: &[f64]) -> Vec<f64> {
        let ang = vec3(&p[3..6]) + vec3(q).cross(&vec3(p));
        vec![p[0], p[1], p[2], ang.x, ang.y, ang.z]
    }

    fn frame_velocity_vjp(&self, v: &[f64], hat_bar: &[f64]) -> Vec<f64> {
        let c = vec3(&v[3..6]).cross(&vec3(hat_bar));
        vec![c.x, c.y, c.z, 0.0, 0.0, 0.0]
    }

    fn frame_bias(&self, v: &[f64]) -> Vec<f64> {
        let c = vec3(v).cross(&vec3(&v[3..6]));
        vec![c.x, c.y, c.z, 0.0, 0.0, 0.0]
    }

    fn frame_bias_vjp(&self, v: &[f64], bar: &[f64]) -> Vec<f64> {
        let (u, w, b) = (vec3(v), vec3(&v[3..6]), vec3(bar));
        let (ub, wb) = (w.cross(&b), b.cross(&u));
        vec![ub.x, ub.y, ub.z, wb.x, wb.y, wb.z]
    }
}
