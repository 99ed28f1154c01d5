//! Drives that hold joints at targets, which are their controls: τ = k (u − q − Δt q̇) − c q̇.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Terms, Together, Velocity};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters};

const STIFFNESS: Declared = Declared::new("servo.stiffness", "N/m or N m/rad");
const DAMPING: Declared = Declared::new("servo.damping", "N s/m or N m s/rad");

struct Servos {
    each: Vec<Servo>,
    /// Δt, s.
    time_step: f64,
}

struct Servo {
    q: usize,
    v: usize,
    control: usize,
    stiffness: Parameter,
    damping: Parameter,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let bodies = parts.scene.bodies.iter().zip(parts.tree.links());
    let servo = |(b, (body, link)): (usize, (&crate::scene::Body, &crate::multibody::Link))| {
        let given = body.servo?;
        let mut declare = |declared, value| parameters.declare(Owner::Body(b), declared, value);
        Some(Servo {
            q: link.q.start,
            v: link.v.start,
            control: parts.bodies[b].joint_control?,
            stiffness: declare(STIFFNESS, given.stiffness),
            damping: declare(DAMPING, given.damping),
        })
    };
    let each: Vec<_> = bodies.enumerate().filter_map(servo).collect();
    let time_step = parts.time_step;
    (!each.is_empty()).then(|| Box::new(Servos { each, time_step }) as Box<dyn ForceModel>)
}

impl Servos {
    /// τ.
    fn force(&self, s: &Servo, at: &Moving) -> f64 {
        let parameters = at.place.parameters;
        parameters[s.stiffness] * self.error(s, at) - parameters[s.damping] * at.v[s.v]
    }

    /// What is left to the target.
    fn error(&self, s: &Servo, at: &Moving) -> f64 {
        at.control[s.control] - at.place.q[s.q] - self.time_step * at.v[s.v]
    }

    /// −∂τ/∂q̇.
    fn slowing(&self, s: &Servo, parameters: &Parameters) -> f64 {
        parameters[s.damping] + self.time_step * parameters[s.stiffness]
    }
}

impl ForceModel for Servos {
    fn name(&self) -> &'static str {
        "servo"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for s in &self.each {
            out.joints[s.v] += self.force(s, at);
        }
    }

    fn efforts(&self, at: &Moving, each: &mut Terms) {
        let parameters = at.place.parameters;
        for s in &self.each {
            let reach = at.control[s.control].abs() + at.place.q[s.q].abs();
            let effort =
                parameters[s.stiffness] * reach + self.slowing(s, parameters) * at.v[s.v].abs();
            each(&|out| out.joints[s.v] += effort);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for s in &self.each {
            out.joints[s.v] -= self.slowing(s, at.place.parameters) * change.v[s.v];
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        for s in &self.each {
            let z = z.v[s.v];
            bar.q[s.v] -= parameters[s.stiffness] * z;
            bar.v[s.v] -= self.slowing(s, parameters) * z;
            bar.control[s.control] += parameters[s.stiffness] * z;
            bar.parameters[s.stiffness] += self.error(s, at) * z;
            bar.parameters[s.damping] -= at.v[s.v] * z;
        }
    }

    fn ahead(&self, at: &Moving, out: &mut Loads) {
        for s in &self.each {
            let stiffness = at.place.parameters[s.stiffness];
            out.joints[s.v] -= stiffness * self.time_step * at.v[s.v];
        }
    }

    fn is_late(&self) -> bool {
        true
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        match self.each.iter().any(|s| group.hangs_on(s.v)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn driven_power(&self, at: &Moving, moving: &Moving) -> f64 {
        self.each
            .iter()
            .map(|s| (self.force(s, at) * moving.v[s.v]).abs())
            .sum()
    }

    fn targets(&self) -> Vec<usize> {
        self.each.iter().map(|s| s.control).collect()
    }
}
