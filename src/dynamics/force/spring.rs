//! Linear springs with dampers between points of two bodies, or of a body and the world.
//!
//! With d from the first end to the second, n = d/|d| and u = ḋ, the tension is T = k (|d| − L) + c n·u; T n acts on the first
//! body, −T n on the second. Where the ends meet there is no direction, and nothing acts; without a rest length the force k d has a slope there all the same.

use super::{
    ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Terms, Together, Velocity,
};
use crate::adjoint::lie::{Vec3, Vec6, angular, point_velocity, point_wrench};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters};
use crate::scene::Force;

const STIFFNESS: Declared = Declared::new("stiffness", "N/m");
const REST_LENGTH: Declared =
    Declared::new("rest_length", "m").size(|value, typical| value.max(0.1 * typical.length));
const DAMPING: Declared = Declared::new("damping", "N s/m");

struct Springs(Vec<Spring>);

struct Spring {
    ends: [End; 2],
    stiffness: Parameter,
    rest_length: Parameter,
    damping: Parameter,
}

/// A point of a body, or of the world.
struct End {
    body: Option<usize>,
    /// In the body's frame, m.
    point: Vec3,
}

/// A spring at a configuration and a velocity.
struct Stretched {
    /// World positions of the ends, m.
    ends: [Vec3; 2],
    /// Unit vector from the first end to the second.
    normal: Vec3,
    length: f64,
    /// Length beyond the rest length, m.
    stretch: f64,
    /// ḋ, m/s.
    velocity: Vec3,
    tension: f64,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let body = |name: &String| scene.body(name).map(|b| b.0);
    let mut springs = Vec::new();
    for (i, force) in scene.forces.iter().enumerate() {
        let Force::Spring(s) = force else { continue };
        let mut declare = |declared, value| {
            parameters.declare(Owner::Named(scene.force_name(i)), declared, value)
        };
        springs.push(Spring {
            ends: [(Some(&s.body), s.at), (s.to.as_ref(), s.to_at)].map(|(name, point)| End {
                body: name.and_then(body),
                point: point.into(),
            }),
            stiffness: declare(STIFFNESS, s.stiffness),
            rest_length: declare(REST_LENGTH, s.rest_length),
            damping: declare(DAMPING, s.damping),
        });
    }
    (!springs.is_empty()).then(|| Box::new(Springs(springs)) as Box<dyn ForceModel>)
}

impl End {
    fn position(&self, place: &Place) -> Vec3 {
        self.body
            .map_or(self.point, |b| place.poses[b].apply(&self.point))
    }

    /// Its six-vector of a field of the bodies; none of the world.
    fn of(&self, field: &[Vec6]) -> Vec6 {
        self.body.map_or(Vec6::zeros(), |b| field[b])
    }

    fn add(&self, wrench: Vec6, out: &mut [Vec6]) {
        if let Some(b) = self.body {
            out[b] += wrench;
        }
    }
}

impl Spring {
    /// Positions of the ends, the direction between them, and their distance.
    fn line(&self, place: &Place) -> ([Vec3; 2], Vec3, f64) {
        let [first, second] = &self.ends;
        let ends = [first.position(place), second.position(place)];
        let d = ends[1] - ends[0];
        let length = d.norm();
        let normal = if length > 0.0 {
            d / length
        } else {
            Vec3::zeros()
        };
        (ends, normal, length)
    }

    /// Velocity of the second end against the first one's, of a field of twists.
    fn rate(&self, ends: &[Vec3; 2], twists: &[Vec6]) -> Vec3 {
        let [first, second] = &self.ends;
        point_velocity(&second.of(twists), &ends[1]) - point_velocity(&first.of(twists), &ends[0])
    }

    fn stretched(&self, at: &Moving) -> Stretched {
        let parameters = at.place.parameters;
        let (ends, normal, length) = self.line(&at.place);
        let velocity = self.rate(&ends, at.twists);
        let stretch = length - parameters[self.rest_length];
        Stretched {
            tension: parameters[self.stiffness] * stretch
                + parameters[self.damping] * normal.dot(&velocity),
            ends,
            normal,
            length,
            stretch,
            velocity,
        }
    }

    /// Adds opposite forces at the ends, `force` at the first.
    fn pull(&self, ends: &[Vec3; 2], force: &Vec3, out: &mut [Vec6]) {
        self.ends[0].add(point_wrench(&ends[0], force), out);
        self.ends[1].add(point_wrench(&ends[1], &-force), out);
    }
}

impl ForceModel for Springs {
    fn name(&self) -> &'static str {
        "spring"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for spring in &self.0 {
            let s = spring.stretched(at);
            spring.pull(&s.ends, &(s.tension * s.normal), &mut out.wrenches);
        }
    }

    fn efforts(&self, at: &Moving, each: &mut Terms) {
        for spring in &self.0 {
            let s = spring.stretched(at);
            let parameters = at.place.parameters;
            let reach = s.ends.iter().map(Vec3::norm).sum::<f64>();
            let held = parameters[spring.stiffness] * (reach + parameters[spring.rest_length]);
            let damped = parameters[spring.damping] * s.velocity.norm();
            let pull = (held + damped) * s.normal;
            each(&|out| spring.pull(&s.ends, &pull, &mut out.wrenches));
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for spring in &self.0 {
            let (ends, normal, _) = spring.line(&at.place);
            let rate = normal.dot(&spring.rate(&ends, change.twists));
            let tension = at.place.parameters[spring.damping] * rate;
            spring.pull(&ends, &(tension * normal), &mut out.wrenches);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for spring in &self.0 {
            let s = spring.stretched(at);
            let parameters = at.place.parameters;
            let (stiffness, damping) = (parameters[spring.stiffness], parameters[spring.damping]);
            if s.length == 0.0 {
                if parameters[spring.rest_length] == 0.0 {
                    let pulled = stiffness * spring.rate(&s.ends, z.twists);
                    spring.pull(&s.ends, &pulled, bar.pose);
                }
                continue;
            }
            let n = &s.normal;
            // The power is T n·w, w the rate at which the virtual velocity shortens the spring.
            let w = -spring.rate(&s.ends, z.twists);
            let shortening = n.dot(&w);
            bar.parameters[spring.stiffness] += s.stretch * shortening;
            bar.parameters[spring.rest_length] -= stiffness * shortening;
            bar.parameters[spring.damping] += n.dot(&s.velocity) * shortening;
            let damped = damping * shortening * n;
            spring.pull(&s.ends, &-damped, bar.twist);
            // Of d: through its length and its direction, dn = (1 − n nᵀ) dd / |d|.
            let across = |x: &Vec3| (x - n * n.dot(x)) / s.length;
            let d_bar = shortening * (stiffness * n + damping * across(&s.velocity))
                + s.tension * across(&w);
            // Of each end: also through the point at which velocities are taken.
            for (end, sign) in [(0, -1.0), (1, 1.0)] {
                let own = &spring.ends[end];
                let x_bar = d_bar + damped.cross(&angular(&own.of(at.twists)))
                    - (s.tension * n).cross(&angular(&own.of(z.twists)));
                own.add(point_wrench(&s.ends[end], &(sign * x_bar)), bar.pose);
            }
        }
    }

    fn resists(&self) -> bool {
        true
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        let both = |s: &Spring| Some([s.ends[0].body?, s.ends[1].body?]);
        Some(self.0.iter().filter_map(both).collect())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let mut each = self.0.iter();
        let across = |s: &Spring| group.across(s.ends[0].body, s.ends[1].body);
        match each.all(|s| across(s) == Outside::Nothing) {
            true => Outside::Nothing,
            false => Outside::All,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.0.iter().all(|s| parameters[s.damping] == 0.0)
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |spring: &Spring| {
            let stretch = spring.line(place).2 - place.parameters[spring.rest_length];
            0.5 * place.parameters[spring.stiffness] * stretch * stretch
        };
        self.0.iter().map(of).sum()
    }
}
