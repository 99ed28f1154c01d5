//! Thrusters: a control wrench on a body, force and moment (world axes) about its origin.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::adjoint::lie::{angular, linear, point_velocity, point_wrench};
use crate::dynamics::{Declarations, Parameters};

/// Bodies, each with the first of its six controls.
struct Thrusters(Vec<(usize, usize)>);

pub(super) fn assemble(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let each = parts.bodies.iter().enumerate();
    let thrusters: Vec<_> = each.filter_map(|(b, d)| Some((b, d.thruster?))).collect();
    (!thrusters.is_empty()).then(|| Box::new(Thrusters(thrusters)) as Box<dyn ForceModel>)
}

impl ForceModel for Thrusters {
    fn name(&self) -> &'static str {
        "thruster"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for &(b, control) in &self.0 {
            let w = at.control.fixed_rows::<6>(control).into_owned();
            out.wrenches[b] += point_wrench(&at.place.poses[b].translation, &linear(&w));
            let mut moment = out.wrenches[b].fixed_rows_mut::<3>(3);
            moment += angular(&w);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for &(b, control) in &self.0 {
            let w = at.control.fixed_rows::<6>(control).into_owned();
            let (origin, virt) = (&at.place.poses[b].translation, &z.twists[b]);
            let rotation = angular(virt);
            bar.pose[b] += point_wrench(origin, &linear(&w).cross(&rotation));
            let velocity = point_velocity(virt, origin);
            for k in 0..3 {
                bar.control[control + k] += velocity[k];
                bar.control[control + 3 + k] += rotation[k];
            }
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        match self.0.iter().any(|(b, _)| group.holds(*b)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, _: &Parameters) -> bool {
        true
    }
}
