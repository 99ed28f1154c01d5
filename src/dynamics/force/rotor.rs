//! Rotors of thrusters: a joint of one velocity n that is driven to a control u by the force (J/T)(u − n).
//!
//! J is the inertia that the rotor alone has along its joint with the scene's parameters, its armature among them, so that ṅ = (u − n)/T where what carries it doesn't turn and the water doesn't
//! hold it (with shape parameters J changes as it does in a scene of another shape): the first-order lag of a speed-controlled motor, whose state is the rotor's velocity.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::adjoint::lie::Vec6;
use crate::adjoint::rigid::{spatial_inertia, spatial_inertia_vjp};
use crate::dynamics::Follows;
use crate::dynamics::parameters::{
    Declarations, Declared, Owner, Parameter, Parameters, Range, center_of_mass, inertia, mass,
};
use std::iter;

const TIME_CONSTANT: Declared = Declared::new("time_constant", "s").range(Range::Positive);

struct Rotors(Vec<Rotor>);

struct Rotor {
    /// Number of its joint's velocity.
    rate: usize,
    control: usize,
    /// J, kg m² or kg.
    inertia: f64,
    time_constant: Parameter,
    /// How J changes with shape parameters.
    shapes: Vec<(Parameter, f64)>,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let mut rotors = Vec::new();
    for (i, control, given) in scene.thrusters() {
        let rotor = given.rotor.as_ref().and_then(|name| scene.body(name));
        let (Some(body), Some(time)) = (rotor, given.time_constant) else {
            continue;
        };
        let (values, link) = (&parts.values[body.0], &parts.tree.links()[body.0]);
        let matrix = spatial_inertia(values.mass, &values.center_of_mass, &values.inertia);
        let along = link.joint.basis()[0];
        let armature = scene.bodies[body.0].passive.map(|p| p.armature);
        let owner = Owner::Named(scene.force_name(i));
        rotors.push(Rotor {
            rate: link.v.start,
            control,
            inertia: along.dot(&(matrix * along)) + armature.unwrap_or(0.0),
            time_constant: parameters.declare(owner, TIME_CONSTANT, time),
            shapes: slopes(parts, body.0, &along),
        });
    }
    (!rotors.is_empty()).then(|| Box::new(Rotors(rotors)) as Box<dyn ForceModel>)
}

/// How the inertia of a body along `along`, its frame, changes with shape parameters that it follows from.
fn slopes(parts: &ForceParts, body: usize, along: &Vec6) -> Vec<(Parameter, f64)> {
    let values = &parts.values[body];
    let bar = along * along.transpose();
    let bar = spatial_inertia_vjp(values.mass, &values.center_of_mass, &bar);
    let by_own = iter::once((mass(body), bar.mass))
        .chain(inertia(body).into_iter().zip(bar.inertia))
        .chain(
            center_of_mass(body)
                .into_iter()
                .zip(bar.center.iter().copied()),
        );
    let by_own: Vec<(Parameter, f64)> = by_own.collect();
    let through = |follows: &Follows| {
        let (_, by_own) = by_own.iter().find(|(own, _)| *own == follows.follower)?;
        Some((follows.shape, by_own * follows.slope))
    };
    parts.shapes.follows.iter().filter_map(through).collect()
}

impl Rotor {
    /// J/T.
    fn gain(&self, parameters: &Parameters) -> f64 {
        self.inertia / parameters[self.time_constant]
    }

    fn force(&self, at: &Moving) -> f64 {
        self.gain(at.place.parameters) * (at.control[self.control] - at.v[self.rate])
    }
}

impl ForceModel for Rotors {
    fn name(&self) -> &'static str {
        "rotor"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for r in &self.0 {
            out.joints[r.rate] += r.force(at);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for r in &self.0 {
            out.joints[r.rate] -= r.gain(at.place.parameters) * change.v[r.rate];
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        for r in &self.0 {
            let (z, gain) = (z.v[r.rate], r.gain(parameters));
            bar.v[r.rate] -= gain * z;
            bar.control[r.control] += gain * z;
            bar.parameters[r.time_constant] -= z * r.force(at) / parameters[r.time_constant];
            for (shape, slope) in &r.shapes {
                bar.parameters[*shape] += z * slope * r.force(at) / r.inertia;
            }
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        match self.0.iter().any(|r| group.hangs_on(r.rate)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn driven_power(&self, at: &Moving, moving: &Moving) -> f64 {
        let power = |r: &Rotor| (r.force(at) * moving.v[r.rate]).abs();
        self.0.iter().map(power).sum()
    }
}
