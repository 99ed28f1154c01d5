//! Accelerations of the bodies, and of the sites: means over steps, with whatever a step solves, contact too.

use super::entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};
use super::frames::Of;
use super::velocity::Velocities;
use crate::dynamics::System;
use crate::scene::Scene;
use crate::{Error, Result};

/// What the velocities gain over a step, by its length.
pub(super) struct Accelerations(pub Of);

impl Observable for Accelerations {
    fn name(&self) -> &'static str {
        self.0.named("accelerations", "site_accelerations")
    }

    fn unit(&self) -> &'static str {
        self.0.named(
            "m/s², of the bodies' origins, and rad/s², world axes: the mean over the step that starts there, at the last state over the one that ends there",
            "m/s², of the sites' origins, and rad/s², world axes: the mean over the step that starts there, at the last state over the one that ends there",
        )
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        Velocities(self.0).shape(system)
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        let linear = ["acceleration_x", "acceleration_y", "acceleration_z"];
        let angular = ["rate_gain_x", "rate_gain_y", "rate_gain_z"];
        self.0.labels(scene, &[linear, angular].concat())
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let Some([before, after]) = at.step else {
            return Err(without_steps(self.name()));
        };
        let of = |sample| self.0.velocities(at.system, sample);
        let gains = of(after).into_iter().zip(of(before));
        Ok(gains.map(|(a, b)| (a - b) / at.time_step).collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

/// The error of an observable over a step where there is none.
pub(in crate::simulate) fn without_steps(name: &str) -> Error {
    Error::Unsupported {
        what: format!("the observable {name:?} of a rollout without steps"),
        why: "it is a mean over a step".into(),
        instead: "run one step at least, or ask the equations of motion for the acceleration"
            .into(),
    }
}

impl Differentiable for Accelerations {
    fn tangents(&self, system: &System) -> usize {
        Velocities(self.0).tangents(system)
    }

    fn is_gain(&self) -> bool {
        true
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        Velocities(self.0).jvp(at, along)
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        Velocities(self.0).vjp(at, bar, out);
    }
}
