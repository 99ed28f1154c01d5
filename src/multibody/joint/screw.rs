//! Rotation about an axis through the frame's origin, with an advance along it: a screw thread.

use super::{Axis, JointMotion, Refused};
use crate::adjoint::lie::{Pose, Vec6, exp_matrix, six};
use std::f64::consts::TAU;

#[derive(Debug)]
pub(super) struct Screw {
    axis: Axis,
    /// Advance in one revolution, m.
    pitch: f64,
}

impl Screw {
    pub fn new(axis: [f64; 3], pitch: f64) -> Self {
        Self {
            axis: Axis::new(axis),
            pitch,
        }
    }
}

impl JointMotion for Screw {
    fn kind(&self) -> &'static str {
        "screw"
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        &["angle"]
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        &["rate"]
    }

    fn basis(&self) -> Vec<Vec6> {
        vec![six(&(self.pitch / TAU * self.axis.unit), &self.axis.unit)]
    }

    fn pose(&self, q: &[f64]) -> Pose {
        let turned = q[0] * self.axis.unit;
        Pose::new(exp_matrix(&turned), self.pitch / TAU * turned)
    }

    fn refused(&self) -> Option<Refused> {
        let pitch = (!self.pitch.is_finite()).then(|| Refused {
            field: "pitch",
            given: self.pitch.to_string(),
            remedy: "give the advance in one revolution, in m; negative for a left-handed thread",
        });
        self.axis.refused().or(pitch)
    }
}
