//! Joint coordinates and generalised velocities.

use super::entry::{Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading};
use crate::Result;
use crate::dynamics::System;
use crate::scene::Scene;

pub(super) struct Coordinates;

impl Observable for Coordinates {
    fn name(&self) -> &'static str {
        "q"
    }

    fn unit(&self) -> &'static str {
        "m, rad, and unit quaternions (w, x, y, z)"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.tree.coordinates()]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        scene.coordinate_labels()
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(at.sample.q.as_slice().to_vec())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Coordinates {
    fn tangents(&self, system: &System) -> usize {
        system.tree.velocities()
    }

    fn tangent_of(&self, system: &System, entry: usize) -> Option<usize> {
        let mut links = system.tree.links().iter();
        let link = links.find(|l| l.q.contains(&entry))?;
        (link.q.len() == link.v.len()).then(|| link.v.start + entry - link.q.start)
    }

    fn jvp(&self, _: &Observed, along: &ObservedTangents) -> Vec<f64> {
        along.q.to_vec()
    }

    fn vjp(&self, _: &Observed, bar: &[f64], out: &mut ObservedBars) {
        for (q, x) in out.q.iter_mut().zip(bar) {
            *q += x;
        }
    }
}

pub(super) struct Velocities;

impl Observable for Velocities {
    fn name(&self) -> &'static str {
        "v"
    }

    fn unit(&self) -> &'static str {
        "m/s and rad/s"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.tree.velocities()]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        scene.velocity_labels()
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        Ok(at.sample.v.as_slice().to_vec())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for Velocities {
    fn tangents(&self, system: &System) -> usize {
        system.tree.velocities()
    }

    fn jvp(&self, _: &Observed, along: &ObservedTangents) -> Vec<f64> {
        along.v.to_vec()
    }

    fn vjp(&self, _: &Observed, bar: &[f64], out: &mut ObservedBars) {
        for (v, x) in out.v.iter_mut().zip(bar) {
            *v += x;
        }
    }
}
