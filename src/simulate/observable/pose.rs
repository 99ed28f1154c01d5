//! Positions and rotations of the bodies, and of the sites.

use super::entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};
use super::frames::Of;
use crate::Result;
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::System;
use crate::scene::Scene;

pub(super) struct Positions(pub Of);

impl Observable for Positions {
    fn name(&self) -> &'static str {
        self.0.named("positions", "site_positions")
    }

    fn unit(&self) -> &'static str {
        self.0.named(
            "m, of the bodies' origins, world axes",
            "m, of the sites' origins, world axes",
        )
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![self.0.count(system), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        self.0
            .labels(scene, &["position_x", "position_y", "position_z"])
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let frames = self.0.frames(at.system, &at.sample.poses);
        Ok(frames
            .flat_map(|(_, p)| <[f64; 3]>::from(p.translation))
            .collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Positions {
    fn tangents(&self, system: &System) -> usize {
        3 * self.0.count(system)
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        frames
            .flat_map(|(b, pose)| {
                let moved = point_velocity(&along.displacement[b], &pose.translation);
                <[f64; 3]>::from(moved)
            })
            .collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        for ((b, pose), bar) in frames.zip(bar.chunks_exact(3)) {
            out.pose[b] += point_wrench(&pose.translation, &Vec3::from_column_slice(bar));
        }
    }
}

/// Rotation matrices, row by row; their cotangents are δθ of δR = δθ × R.
pub(super) struct Rotations(pub Of);

impl Observable for Rotations {
    fn name(&self) -> &'static str {
        self.0.named("rotations", "site_rotations")
    }

    fn unit(&self) -> &'static str {
        self.0.named("1, body to world", "1, site to world")
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![self.0.count(system), 3, 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        const ENTRIES: [&str; 9] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];
        let names = ENTRIES.map(|e| format!("rotation_{e}"));
        self.0.labels(scene, &names.each_ref().map(String::as_str))
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let frames = self.0.frames(at.system, &at.sample.poses);
        Ok(frames
            .flat_map(|(_, p)| p.rotation.transpose().as_slice().to_vec())
            .collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Rotations {
    fn tangents(&self, system: &System) -> usize {
        3 * self.0.count(system)
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        frames
            .flat_map(|(b, _)| <[f64; 3]>::from(angular(&along.displacement[b])))
            .collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        for ((b, _), bar) in frames.zip(bar.chunks_exact(3)) {
            let mut moment = out.pose[b].fixed_rows_mut::<3>(3);
            moment += Vec3::from_column_slice(bar);
        }
    }
}
