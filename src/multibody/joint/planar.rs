//! Translations in a plane, then the rotation about its normal.

use super::JointMotion;
use crate::adjoint::lie::{Mat3, Pose, Vec3, Vec6, exp_matrix, six};
use serde::{Deserialize, Serialize};

/// A plane of a planar joint, by its two translations in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plane {
    /// y, z, rotation about x.
    Yz,
    /// z, x, rotation about y.
    Zx,
    /// x, y, rotation about z.
    Xy,
}

#[derive(Debug)]
pub(super) struct Planar {
    plane: Plane,
    /// Directions of the translations and the normal, right-handed.
    axes: Mat3,
}

impl Planar {
    pub fn new(plane: Plane) -> Self {
        let (x, y, z) = (Vec3::x(), Vec3::y(), Vec3::z());
        let axes = match plane {
            Plane::Yz => [y, z, x],
            Plane::Zx => [z, x, y],
            Plane::Xy => [x, y, z],
        };
        Self {
            plane,
            axes: Mat3::from_columns(&axes),
        }
    }
}

impl JointMotion for Planar {
    fn kind(&self) -> &'static str {
        "planar"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        match self.plane {
            Plane::Yz => &["y", "z", "angle"],
            Plane::Zx => &["z", "x", "angle"],
            Plane::Xy => &["x", "y", "angle"],
        }
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        match self.plane {
            Plane::Yz => &["vy", "vz", "rate"],
            Plane::Zx => &["vz", "vx", "rate"],
            Plane::Xy => &["vx", "vy", "rate"],
        }
    }

    fn basis(&self) -> Vec<Vec6> {
        let (zero, axis) = (Vec3::zeros(), |k| self.axes.column(k).into_owned());
        vec![
            six(&axis(0), &zero),
            six(&axis(1), &zero),
            six(&zero, &axis(2)),
        ]
    }

    fn pose(&self, q: &[f64]) -> Pose {
        Pose::new(
            exp_matrix(&(q[2] * self.axes.column(2))),
            q[0] * self.axes.column(0) + q[1] * self.axes.column(1),
        )
    }

    fn has_frame_map(&self) -> bool {
        true
    }

    fn frame_velocity(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        vec![v[0] + v[2] * q[1], v[1] - v[2] * q[0], v[2]]
    }

    fn frame_velocity_inverse(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        vec![hat[0] - hat[2] * q[1], hat[1] + hat[2] * q[0], hat[2]]
    }

    fn frame_momentum_transpose(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        vec![hat[0], hat[1], hat[2] + q[1] * hat[0] - q[0] * hat[1]]
    }

    fn frame_momentum(&self, q: &[f64], p: &[f64]) -> Vec<f64> {
        vec![p[0], p[1], p[2] - q[1] * p[0] + q[0] * p[1]]
    }

    fn frame_velocity_vjp(&self, v: &[f64], hat_bar: &[f64]) -> Vec<f64> {
        vec![-v[2] * hat_bar[1], v[2] * hat_bar[0], 0.0]
    }

    fn frame_bias(&self, v: &[f64]) -> Vec<f64> {
        vec![v[2] * v[1], -v[2] * v[0], 0.0]
    }

    fn frame_bias_vjp(&self, v: &[f64], bar: &[f64]) -> Vec<f64> {
        vec![-v[2] * bar[1], v[2] * bar[0], v[1] * bar[0] - v[0] * bar[1]]
    }
}
