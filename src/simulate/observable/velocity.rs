//! Velocities of the bodies.

use super::entry::{Observable, Reading, by_body};
use crate::Result;
use crate::adjoint::lie::{angular, point_velocity};
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
