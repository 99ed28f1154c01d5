//! Velocities of the bodies.

use super::entry::{
    Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading, by_body,
};
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6, angular, point_velocity, point_wrench, six};
use crate::dynamics::System;
use crate::scene::Scene;

/// See [`velocities`].
pub(super) struct Velocities;

impl Observable for Velocities {
    fn name(&self) -> &'static str {
        "velocities"
    }

    fn unit(&self) -> &'static str {
        "m/s, of the bodies' origins, and rad/s, world axes"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.len(), 6]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        let linear = ["velocity_x", "velocity_y", "velocity_z"];
        let rates = ["rate_x", "rate_y", "rate_z"];
        by_body(scene, &[linear, rates].concat())
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(velocities(at))
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Velocities {
    fn tangents(&self, system: &System) -> usize {
        6 * system.len()
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let of = |(b, twist): (usize, &Vec6)| {
            let origin = at.kinematics.poses[b].translation;
            // At a given twist the origin's velocity is V + ω × x.
            let moved = point_velocity(&along.displacement[b], &origin);
            let rate = point_velocity(twist, &origin) + angular(&at.twists[b]).cross(&moved);
            let rates: [f64; 3] = angular(twist).into();
            <[f64; 3]>::from(rate).into_iter().chain(rates)
        };
        along.twist.iter().enumerate().flat_map(of).collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        for (b, bar) in bar.chunks_exact(6).enumerate() {
            let (bar, rates) = bar.split_at(3);
            let (bar, rates) = (Vec3::from_column_slice(bar), Vec3::from_column_slice(rates));
            let origin = at.kinematics.poses[b].translation;
            out.twist[b] += point_wrench(&origin, &bar) + six(&Vec3::zeros(), &rates);
            // At a given twist the origin's velocity is V + ω × x.
            let moved = bar.cross(&angular(&at.twists[b]));
            out.pose[b] += point_wrench(&origin, &moved);
        }
    }
}

/// Of each body's origin, and angular.
pub(in crate::simulate) fn velocities(at: &Reading) -> Vec<f64> {
    let (tree, sample) = (&at.system.tree, at.sample);
    let twists = tree.twists(&tree.kinematics(&sample.q), &sample.v);
    let bodies = twists.iter().zip(&sample.poses);
    bodies
        .flat_map(|(twist, pose)| {
            let origin: [f64; 3] = point_velocity(twist, &pose.translation).into();
            let rates: [f64; 3] = angular(twist).into();
            origin.into_iter().chain(rates)
        })
        .collect()
}
