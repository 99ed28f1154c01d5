//! Positions and rotations of the bodies.

use super::entry::{
    Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading, by_body,
};
use crate::Result;
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::System;
use crate::scene::Scene;

pub(super) struct Positions;

impl Observable for Positions {
    fn name(&self) -> &'static str {
        "positions"
    }

    fn unit(&self) -> &'static str {
        "m, of the bodies' origins, world axes"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.len(), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        by_body(scene, &["position_x", "position_y", "position_z"])
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let poses = at.sample.poses.iter();
        Ok(poses
            .flat_map(|p| <[f64; 3]>::from(p.translation))
            .collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Positions {
    fn tangents(&self, system: &System) -> usize {
        3 * system.len()
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let bodies = at.kinematics.poses.iter().zip(along.displacement);
        bodies
            .flat_map(|(pose, z)| <[f64; 3]>::from(point_velocity(z, &pose.translation)))
            .collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let bodies = at.kinematics.poses.iter().zip(bar.chunks_exact(3));
        for (out, (pose, bar)) in out.pose.iter_mut().zip(bodies) {
            *out += point_wrench(&pose.translation, &Vec3::from_column_slice(bar));
        }
    }
}

/// Rotation matrices, row by row; their cotangents are δθ of δR = δθ × R.
pub(super) struct Rotations;

impl Observable for Rotations {
    fn name(&self) -> &'static str {
        "rotations"
    }

    fn unit(&self) -> &'static str {
        "1, body to world"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.len(), 3, 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        const ENTRIES: [&str; 9] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];
        let names = ENTRIES.map(|e| format!("rotation_{e}"));
        by_body(scene, &names.each_ref().map(String::as_str))
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let poses = at.sample.poses.iter();
        Ok(poses
            .flat_map(|p| p.rotation.transpose().as_slice().to_vec())
            .collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Rotations {
    fn tangents(&self, system: &System) -> usize {
        3 * system.len()
    }

    fn jvp(&self, _: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let turned = along.displacement.iter();
        turned.flat_map(|z| <[f64; 3]>::from(angular(z))).collect()
    }

    fn vjp(&self, _: &Observed, bar: &[f64], out: &mut ObservedBars) {
        for (out, bar) in out.pose.iter_mut().zip(bar.chunks_exact(3)) {
            let mut moment = out.fixed_rows_mut::<3>(3);
            moment += Vec3::from_column_slice(bar);
        }
    }
}
