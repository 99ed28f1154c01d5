//! Springs, damping and friction of joints with one coordinate: τ = −k (q − q₀) − c q̇ − τ_f q̇ / √(q̇² + v_f²).

use super::{
    ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Terms, Together, Velocity,
};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};

const STIFFNESS: Declared = Declared::new("joint.stiffness", "N/m or N m/rad");
const REST: Declared = Declared::new("joint.rest", "m or rad")
    .range(Range::Finite)
    .size(|value, _| value.abs().max(0.1));
const DAMPING: Declared = Declared::new("joint.damping", "N s/m or N m s/rad");
const FRICTION: Declared = Declared::new("joint.friction", "N or N m");

struct Passives(Vec<Passive>);

struct Passive {
    q: usize,
    v: usize,
    stiffness: Parameter,
    rest: Parameter,
    damping: Parameter,
    friction: Parameter,
    friction_speed: f64,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let bodies = parts.scene.bodies.iter().zip(parts.tree.links());
    let mut joints = Vec::new();
    for (b, (body, link)) in bodies.enumerate() {
        let Some(given) = &body.passive else { continue };
        let mut declare = |declared, value| parameters.declare(Owner::Body(b), declared, value);
        joints.push(Passive {
            q: link.q.start,
            v: link.v.start,
            stiffness: declare(STIFFNESS, given.stiffness),
            rest: declare(REST, given.rest),
            damping: declare(DAMPING, given.damping),
            friction: declare(FRICTION, given.friction),
            friction_speed: given.friction_speed,
        });
    }
    (!joints.is_empty()).then(|| Box::new(Passives(joints)) as Box<dyn ForceModel>)
}

impl Passive {
    fn stretch(&self, place: &Place) -> f64 {
        place.q[self.q] - place.parameters[self.rest]
    }

    /// q̇ / √(q̇² + v_f²) and its derivative.
    fn direction(&self, rate: f64) -> (f64, f64) {
        let speed = rate.hypot(self.friction_speed);
        let across = self.friction_speed / speed;
        (rate / speed, across * across / speed)
    }

    /// −∂τ/∂q̇.
    fn slowing(&self, at: &Moving) -> f64 {
        let parameters = at.place.parameters;
        let (_, slope) = self.direction(at.v[self.v]);
        parameters[self.damping] + parameters[self.friction] * slope
    }
}

impl ForceModel for Passives {
    fn name(&self) -> &'static str {
        "passive joint"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let parameters = at.place.parameters;
        for joint in &self.0 {
            let rate = at.v[joint.v];
            let (direction, _) = joint.direction(rate);
            out.joints[joint.v] -= parameters[joint.stiffness] * joint.stretch(&at.place)
                + parameters[joint.damping] * rate
                + parameters[joint.friction] * direction;
        }
    }

    fn efforts(&self, at: &Moving, each: &mut Terms) {
        let parameters = at.place.parameters;
        for joint in &self.0 {
            let rate = at.v[joint.v].abs();
            let reach = at.place.q[joint.q].abs() + parameters[joint.rest].abs();
            let effort = parameters[joint.stiffness] * reach
                + parameters[joint.damping] * rate
                + parameters[joint.friction];
            each(&|out| out.joints[joint.v] += effort);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for joint in &self.0 {
            out.joints[joint.v] -= joint.slowing(at) * change.v[joint.v];
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let stiffness = |joint: &Passive| at.place.parameters[joint.stiffness];
        for joint in &self.0 {
            let (z, rate) = (z.v[joint.v], at.v[joint.v]);
            bar.q[joint.v] -= stiffness(joint) * z;
            bar.v[joint.v] -= joint.slowing(at) * z;
            bar.parameters[joint.stiffness] -= joint.stretch(&at.place) * z;
            bar.parameters[joint.rest] += stiffness(joint) * z;
            bar.parameters[joint.damping] -= rate * z;
            bar.parameters[joint.friction] -= joint.direction(rate).0 * z;
        }
    }

    fn is_late(&self) -> bool {
        true
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, parameters: &Parameters) -> Outside {
        let acts = |joint: &Passive| {
            let strengths = [joint.stiffness, joint.damping, joint.friction];
            strengths.iter().any(|p| parameters[*p] != 0.0)
        };
        let mut felt = self.0.iter().filter(|joint| acts(joint));
        match felt.any(|joint| group.hangs_on(joint.v)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        let lossless = |j: &Passive| {
            [j.damping, j.friction]
                .iter()
                .all(|p| parameters[*p] == 0.0)
        };
        self.0.iter().all(lossless)
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |joint: &Passive| {
            let stretch = joint.stretch(place);
            0.5 * place.parameters[joint.stiffness] * stretch * stretch
        };
        self.0.iter().map(of).sum()
    }
}
