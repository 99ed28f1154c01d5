//! Attitudes of the bodies, and of the sites: roll, pitch and yaw, as an inertial unit tells them.

use super::entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};
use super::frames::Of;
use crate::Result;
use crate::adjoint::lie::{Mat3, Pose, Vec3, angular};
use crate::dynamics::System;
use crate::scene::Scene;

/// Least cosine of the pitch that derivatives divide by: at a right angle roll and yaw aren't told apart.
const UPRIGHT: f64 = 1e-9;

/// Roll φ, pitch θ and yaw ψ of R = R_z(ψ) R_y(θ) R_x(φ), rad: roll and yaw within (−π, π], pitch within [−π/2, π/2].
pub(super) struct Attitudes(pub Of);

impl Observable for Attitudes {
    fn name(&self) -> &'static str {
        self.0.named("attitudes", "site_attitudes")
    }

    fn unit(&self) -> &'static str {
        self.0.named(
            "rad, roll, pitch and yaw of the bodies: R = Rz(yaw) Ry(pitch) Rx(roll)",
            "rad, roll, pitch and yaw of the sites: R = Rz(yaw) Ry(pitch) Rx(roll)",
        )
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![self.0.count(system), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        self.0.labels(scene, &["roll", "pitch", "yaw"])
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let frames = self.0.frames(at.system, &at.sample.poses);
        Ok(frames.flat_map(|(_, pose)| angles(&pose)).collect())
    }

    fn is_angle(&self) -> bool {
        true
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

/// Roll, pitch and yaw.
fn angles(pose: &Pose) -> [f64; 3] {
    let r = &pose.rotation;
    let level = r[(0, 0)].hypot(r[(1, 0)]);
    [
        r[(2, 1)].atan2(r[(2, 2)]),
        (-r[(2, 0)]).atan2(level),
        r[(1, 0)].atan2(r[(0, 0)]),
    ]
}

/// Rates of roll, pitch and yaw by the angular velocity, world axes.
fn rates(pose: &Pose) -> Mat3 {
    let [_, pitch, yaw] = angles(pose);
    let ((s, c), cosine) = (yaw.sin_cos(), pitch.cos().max(UPRIGHT));
    let tangent = pitch.sin() / cosine;
    Mat3::new(
        c / cosine,
        s / cosine,
        0.0,
        -s,
        c,
        0.0,
        c * tangent,
        s * tangent,
        1.0,
    )
}

impl Differentiable for Attitudes {
    fn tangents(&self, system: &System) -> usize {
        3 * self.0.count(system)
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        frames
            .flat_map(|(b, pose)| <[f64; 3]>::from(rates(&pose) * angular(&along.displacement[b])))
            .collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        for ((b, pose), bar) in frames.zip(bar.chunks_exact(3)) {
            let mut moment = out.pose[b].fixed_rows_mut::<3>(3);
            moment += rates(&pose).tr_mul(&Vec3::from_column_slice(bar));
        }
    }
}
