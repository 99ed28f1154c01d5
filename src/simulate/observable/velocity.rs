//! Velocities of the bodies, and of the sites.

use super::entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};
use super::frames::Of;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, angular, point_velocity, point_wrench, six};
use crate::dynamics::System;
use crate::scene::Scene;
use crate::simulate::Sample;

/// See [`velocities`].
pub(super) struct Velocities(pub Of);

impl Observable for Velocities {
    fn name(&self) -> &'static str {
        self.0.named("velocities", "site_velocities")
    }

    fn unit(&self) -> &'static str {
        self.0.named(
            "m/s, of the bodies' origins, and rad/s, world axes",
            "m/s, of the sites' origins, and rad/s, world axes",
        )
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![self.0.count(system), 6]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        let linear = ["velocity_x", "velocity_y", "velocity_z"];
        let rates = ["rate_x", "rate_y", "rate_z"];
        self.0.labels(scene, &[linear, rates].concat())
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(self.0.velocities(at.system, at.sample))
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Velocities {
    fn tangents(&self, system: &System) -> usize {
        6 * self.0.count(system)
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let of = |(b, pose): (usize, Pose)| {
            let (origin, twist) = (pose.translation, &along.twist[b]);
            // At a given twist the origin's velocity is V + ω × x.
            let moved = point_velocity(&along.displacement[b], &origin);
            let rate = point_velocity(twist, &origin) + angular(&at.twists[b]).cross(&moved);
            let rates: [f64; 3] = angular(twist).into();
            <[f64; 3]>::from(rate).into_iter().chain(rates)
        };
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        frames.flat_map(of).collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        for ((b, pose), bar) in frames.zip(bar.chunks_exact(6)) {
            let (bar, rates) = bar.split_at(3);
            let (bar, rates) = (Vec3::from_column_slice(bar), Vec3::from_column_slice(rates));
            let origin = pose.translation;
            out.twist[b] += point_wrench(&origin, &bar) + six(&Vec3::zeros(), &rates);
            // At a given twist the origin's velocity is V + ω × x.
            let moved = bar.cross(&angular(&at.twists[b]));
            out.pose[b] += point_wrench(&origin, &moved);
        }
    }
}

/// Angular velocities in own axes, as a gyroscope tells them.
pub(super) struct Gyros(pub Of);

impl Observable for Gyros {
    fn name(&self) -> &'static str {
        self.0.named("gyros", "site_gyros")
    }

    fn unit(&self) -> &'static str {
        self.0.named(
            "rad/s, angular velocity in the body's own axes",
            "rad/s, angular velocity in the site's own axes",
        )
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![self.0.count(system), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        self.0.labels(scene, &["gyro_x", "gyro_y", "gyro_z"])
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let (tree, sample) = (&at.system.tree, at.sample);
        let twists = tree.twists(&tree.kinematics(&sample.q), &sample.v);
        let frames = self.0.frames(at.system, &sample.poses);
        Ok(frames
            .flat_map(|(b, pose)| <[f64; 3]>::from(pose.rotation.tr_mul(&angular(&twists[b]))))
            .collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Gyros {
    fn tangents(&self, system: &System) -> usize {
        3 * self.0.count(system)
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let of = |(b, pose): (usize, Pose)| {
            let turned = angular(&along.displacement[b]).cross(&angular(&at.twists[b]));
            let rate = angular(&along.twist[b]) - turned;
            <[f64; 3]>::from(pose.rotation.tr_mul(&rate))
        };
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        frames.flat_map(of).collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        let frames = self.0.frames(at.system, &at.kinematics.poses);
        for ((b, pose), bar) in frames.zip(bar.chunks_exact(3)) {
            let bar = pose.rotation * Vec3::from_column_slice(bar);
            out.twist[b] += six(&Vec3::zeros(), &bar);
            out.pose[b] -= six(&Vec3::zeros(), &angular(&at.twists[b]).cross(&bar));
        }
    }
}

/// Of each body's origin, and angular.
pub(in crate::simulate) fn velocities(at: &Reading) -> Vec<f64> {
    Of::Bodies.velocities(at.system, at.sample)
}

impl Of {
    pub(super) fn velocities(self, system: &System, sample: &Sample) -> Vec<f64> {
        let tree = &system.tree;
        let twists = tree.twists(&tree.kinematics(&sample.q), &sample.v);
        let frames = self.frames(system, &sample.poses);
        frames
            .flat_map(|(b, pose)| {
                let origin: [f64; 3] = point_velocity(&twists[b], &pose.translation).into();
                let rates: [f64; 3] = angular(&twists[b]).into();
                origin.into_iter().chain(rates)
            })
            .collect()
    }
}
