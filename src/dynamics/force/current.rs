//! The inertia of water whose own velocity changes: what a body feels of its added mass in a stream by depth and time, and of the pressure that accelerates the stream.
//!
//! The body's own added mass alone has part in it ([`crate::adjoint::stream`]): in bodies that feel each other, and at walls, the water's answer to the stream is that of each alone.

use super::displaced::{Displaced, of_bodies, of_floats};
use super::stream::{Streams, Undisturbed};
use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, angular, cross_force, linear, six};
use crate::adjoint::stream::{Stream, stream_wrench, stream_wrench_jvp, stream_wrench_vjp};
use crate::dynamics::Parameters;
use crate::dynamics::parameters::{DENSITY, Declarations};
use std::sync::Arc;

struct Carried {
    bodies: Vec<Body>,
    streams: Arc<Streams>,
}

struct Body {
    body: usize,
    /// Its own added mass at unit density, body's frame, about its origin, if it is in the water.
    added: Option<Mat6>,
    /// What it and its floats displace.
    displaced: Vec<Displaced>,
}

/// A body in the stream, its own frame.
struct Streamed<'m> {
    pose: &'m Pose,
    /// Twist through the uniform steady current, world and body.
    past: Vec6,
    nu: Vec6,
    /// World and body.
    water: Undisturbed,
    stream: Stream,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    if parts.streams.is_empty() || parts.scene.fluid.density <= 0.0 {
        return None;
    }
    let mut displaced = of_bodies(parts);
    displaced.extend(of_floats(parts, parameters));
    let body = |body: usize| {
        let own = parts.added_mass.iter().find(|(b, _)| *b == body);
        Body {
            body,
            added: own.map(|(_, added)| *added),
            displaced: displaced
                .iter()
                .filter(|d| d.body == body)
                .copied()
                .collect(),
        }
    };
    let bodies = (0..parts.bodies.len()).map(body);
    let bodies: Vec<_> = bodies
        .filter(|b| b.added.is_some() || !b.displaced.is_empty())
        .collect();
    (!bodies.is_empty()).then(|| {
        Box::new(Carried {
            bodies,
            streams: parts.streams.clone(),
        }) as Box<dyn ForceModel>
    })
}

impl Carried {
    fn streamed<'m>(&self, b: usize, at: &'m Moving) -> Streamed<'m> {
        let pose = &at.place.poses[b];
        let past = at.twists[b] - six(at.current, &Vec3::zeros());
        let water = self.streams.at_body(b, &at.place);
        let turned = |x: &Vec3| pose.rotation.tr_mul(x);
        Streamed {
            pose,
            past,
            nu: pose.twist_to_body(&past),
            water,
            stream: Stream {
                velocity: turned(&water.velocity),
                acceleration: turned(&water.acceleration),
            },
        }
    }
}

/// The wrench of a pressure that accelerates the water, per mass of what is displaced at a point, body's frame.
fn pressed(center: &Vec3, stream: &Stream) -> Vec6 {
    six(&stream.acceleration, &center.cross(&stream.acceleration))
}

impl Body {
    /// The wrench at unit density, body's frame.
    fn unit(&self, at: &Streamed, parameters: &Parameters) -> Vec6 {
        let own = self
            .added
            .map(|added| stream_wrench(&added, &at.nu, &at.stream));
        let each = self.displaced.iter().map(|displaced| {
            let center = displaced.point.at(parameters);
            parameters[displaced.volume] * pressed(&center, &at.stream)
        });
        own.into_iter().chain(each).sum()
    }
}

impl ForceModel for Carried {
    fn name(&self) -> &'static str {
        "current"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let parameters = at.place.parameters;
        for body in &self.bodies {
            let s = self.streamed(body.body, at);
            let wrench = parameters.density() * body.unit(&s, parameters);
            out.wrenches[body.body] += s.pose.wrench_to_world(&wrench);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        let still = Stream {
            velocity: Vec3::zeros(),
            acceleration: Vec3::zeros(),
        };
        for body in &self.bodies {
            let Some(added) = &body.added else { continue };
            let s = self.streamed(body.body, at);
            let dnu = s.pose.twist_to_body(&change.twists[body.body]);
            let unit = stream_wrench_jvp(added, &s.nu, &s.stream, &dnu, &still);
            let wrench = at.place.parameters.density() * unit;
            out.wrenches[body.body] += s.pose.wrench_to_world(&wrench);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        let density = parameters.density();
        for body in &self.bodies {
            let b = body.body;
            let virt = &z.twists[b];
            if *virt == Vec6::zeros() {
                continue;
            }
            let s = self.streamed(b, at);
            let zeta = s.pose.twist_to_body(virt);
            let unit = body.unit(&s, parameters);
            bar.parameters[DENSITY] += zeta.dot(&unit);
            let world = |x: &Vec3| s.pose.rotation * x;
            let mut water_bar = Undisturbed::default();
            if let Some(added) = &body.added {
                let made = stream_wrench_vjp(added, &s.nu, &s.stream, &(density * zeta));
                let nu_bar = s.pose.wrench_to_world(&made.nu);
                bar.twist[b] += nu_bar;
                bar.pose[b] -= cross_force(&s.past, &nu_bar);
                water_bar.velocity += world(&made.stream.velocity);
                water_bar.acceleration += world(&made.stream.acceleration);
            }
            for displaced in &body.displaced {
                let center = displaced.point.at(parameters);
                let mass = density * parameters[displaced.volume];
                let along = zeta.dot(&pressed(&center, &s.stream));
                bar.parameters[displaced.volume] += density * along;
                let center_bar = mass * s.stream.acceleration.cross(&angular(&zeta));
                displaced.point.add(&center_bar, bar.parameters);
                let pushed = linear(&zeta) + angular(&zeta).cross(&center);
                water_bar.acceleration += world(&(mass * pushed));
            }
            // The rotation of the frame acts on both twists, and on what is known of the water.
            let wrench = s.pose.wrench_to_world(&(density * unit));
            bar.pose[b] -= cross_force(virt, &wrench);
            let turned = water_bar.velocity.cross(&s.water.velocity)
                + water_bar.acceleration.cross(&s.water.acceleration);
            bar.pose[b] += six(&Vec3::zeros(), &turned);
            self.streams.at_body_vjp(b, &at.place, &water_bar, bar);
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, parameters: &Parameters) -> Outside {
        let held = self.bodies.iter().any(|body| group.holds(body.body));
        match held && !self.streams.rest(parameters) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.streams.rest(parameters)
    }
}
