//! Tendons over joints at fixed lever arms: T = k (g u − Σ r q) − c Σ r q̇ on each joint by its arm.

use super::{
    ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Terms, Together, Velocity,
};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};
use nalgebra::DVector;

const STIFFNESS: Declared = Declared::new("stiffness", "N/m");
const DAMPING: Declared = Declared::new("damping", "N s/m");
const GAIN: Declared = Declared::new("gain", "m")
    .range(Range::Finite)
    .size(|value, _| value.abs());

struct Tendons(Vec<Tendon>);

struct Tendon {
    control: usize,
    over: Vec<Over>,
    stiffness: Parameter,
    damping: Parameter,
    gain: Parameter,
}

/// A joint that it runs over.
struct Over {
    body: usize,
    q: usize,
    v: usize,
    arm: f64,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let (scene, links) = (parts.scene, parts.tree.links());
    let mut each = Vec::new();
    for (i, control, given) in scene.tendons() {
        let owner = Owner::Named(scene.force_name(i));
        let mut declare = |declared, value| parameters.declare(owner.clone(), declared, value);
        let over = given.arms.iter().filter_map(|(name, arm)| {
            let body = scene.body(name)?.0;
            Some(Over {
                body,
                q: links[body].q.start,
                v: links[body].v.start,
                arm: *arm,
            })
        });
        each.push(Tendon {
            control,
            over: over.collect(),
            stiffness: declare(STIFFNESS, given.stiffness),
            damping: declare(DAMPING, given.damping),
            gain: declare(GAIN, given.gain),
        });
    }
    (!each.is_empty()).then(|| Box::new(Tendons(each)) as Box<dyn ForceModel>)
}

impl Tendon {
    fn length(&self, q: &DVector<f64>) -> f64 {
        self.over.iter().map(|o| o.arm * q[o.q]).sum()
    }

    fn rate(&self, v: &DVector<f64>) -> f64 {
        self.over.iter().map(|o| o.arm * v[o.v]).sum()
    }

    fn tension(&self, at: &Moving) -> f64 {
        let parameters = at.place.parameters;
        parameters[self.stiffness] * self.error(at) - parameters[self.damping] * self.rate(at.v)
    }

    fn pull(&self, tension: f64, out: &mut Loads) {
        for o in &self.over {
            out.joints[o.v] += o.arm * tension;
        }
    }

    /// What is left to where it is pulled to, m.
    fn error(&self, at: &Moving) -> f64 {
        at.place.parameters[self.gain] * at.control[self.control] - self.length(at.place.q)
    }
}

impl ForceModel for Tendons {
    fn name(&self) -> &'static str {
        "tendon"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        self.0.iter().for_each(|t| t.pull(t.tension(at), out));
    }

    fn efforts(&self, at: &Moving, each: &mut Terms) {
        for t in &self.0 {
            each(&|out| t.pull(t.tension(at), out));
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for t in &self.0 {
            let tension = -at.place.parameters[t.damping] * t.rate(change.v);
            for o in &t.over {
                out.joints[o.v] += o.arm * tension;
            }
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        for t in &self.0 {
            // Of the tension.
            let tension = t.rate(z.v);
            let (k, c, g) = (
                parameters[t.stiffness],
                parameters[t.damping],
                parameters[t.gain],
            );
            for o in &t.over {
                bar.q[o.v] -= k * o.arm * tension;
                bar.v[o.v] -= c * o.arm * tension;
            }
            let u = at.control[t.control];
            bar.control[t.control] += k * g * tension;
            bar.parameters[t.stiffness] += t.error(at) * tension;
            bar.parameters[t.damping] -= t.rate(at.v) * tension;
            bar.parameters[t.gain] += k * u * tension;
        }
    }

    fn resists(&self) -> bool {
        true
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        let pairs = |t: &Tendon| -> Vec<[usize; 2]> {
            let each = t.over.windows(2);
            each.map(|o| [o[0].body, o[1].body]).collect()
        };
        Some(self.0.iter().flat_map(pairs).collect())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let mut over = self.0.iter().flat_map(|t| &t.over);
        match over.any(|o| group.hangs_on(o.v)) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.0.iter().all(|t| parameters[t.damping] == 0.0)
    }

    fn driven_power(&self, at: &Moving, moving: &Moving) -> f64 {
        let parameters = at.place.parameters;
        let power = |t: &Tendon| {
            let pulled = parameters[t.gain] * at.control[t.control];
            (parameters[t.stiffness] * pulled * t.rate(moving.v)).abs()
        };
        self.0.iter().map(power).sum()
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |t: &Tendon| 0.5 * place.parameters[t.stiffness] * t.length(place.q).powi(2);
        self.0.iter().map(of).sum()
    }
}
