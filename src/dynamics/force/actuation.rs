//! Actuated joints: controls are their generalised forces, in the user's coordinates.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::dynamics::{Declarations, Parameters};
use std::ops::Range;

/// Velocities of each actuated joint, with the first of its controls.
struct Actuation(Vec<(Range<usize>, usize)>);

pub(super) fn assemble(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let each = parts.bodies.iter().zip(parts.tree.links());
    let each = each.zip(&parts.scene.bodies);
    let joints: Vec<_> = each
        .filter(|(_, given)| given.servo.is_none())
        .filter_map(|((body, link), _)| Some((link.v.clone(), body.joint_control?)))
        .collect();
    (!joints.is_empty()).then(|| Box::new(Actuation(joints)) as Box<dyn ForceModel>)
}

impl ForceModel for Actuation {
    fn name(&self) -> &'static str {
        "actuation"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for (v, control) in &self.0 {
            for (k, i) in v.clone().enumerate() {
                out.joints[i] += at.control[control + k];
            }
        }
    }

    fn vjp(&self, _: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for (v, control) in &self.0 {
            for (k, i) in v.clone().enumerate() {
                bar.control[control + k] += z.v[i];
            }
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let mut joints = self.0.iter().flat_map(|(v, _)| v.clone());
        match joints.any(|i| group.hangs_on(i)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, _: &Parameters) -> bool {
        true
    }
}
