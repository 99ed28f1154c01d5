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
    displaced: Vec<Displaced>,
    streams: Arc<Streams>,
}

struct Body {
    body: usize,
    /// Its own added mass at unit density, body's frame, about its origin.
    added: Mat6,
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
    let own = parts.added_mass.iter();
    let bodies = own.map(|(body, added)| Body {
        body: *body,
        added: *added,
    });
    let mut displaced = of_bodies(parts);
    displaced.extend(of_floats(parts, parameters));
    Some(Box::new(Carried {
        bodies: bodies.collect(),
        displaced,
        streams: parts.streams.clone(),
    }))
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

    /// Adds what belongs to the water at a body and to its pose, of cotangents in the body's frame; `wrench` is what acts there, world.
    fn add_stream_bar(
        &self,
        b: usize,
        (at, s): (&Moving, &Streamed),
        (virt, wrench): (&Vec6, &Vec6),
        own: &Stream,
        bar: &mut LoadBars,
    ) {
        let world = |x: &Vec3| s.pose.rotation * x;
        let water_bar = Undisturbed {
            velocity: world(&own.velocity),
            acceleration: world(&own.acceleration),
        };
        // The rotation of the frame acts on the virtual twist, and on what is known of the water.
        bar.pose[b] -= cross_force(virt, wrench);
        let turned = water_bar.velocity.cross(&s.water.velocity)
            + water_bar.acceleration.cross(&s.water.acceleration);
        bar.pose[b] += six(&Vec3::zeros(), &turned);
        self.streams.at_body_vjp(b, &at.place, &water_bar, bar);
    }
}

/// The wrench of a pressure that accelerates the water, per mass of what is displaced at a point, body's frame.
fn pressed(center: &Vec3, stream: &Stream) -> Vec6 {
    six(&stream.acceleration, &center.cross(&stream.acceleration))
}

fn mass(displaced: &Displaced, parameters: &Parameters) -> f64 {
    parameters.density() * parameters[displaced.volume]
}

impl ForceModel for Carried {
    fn name(&self) -> &'static str {
        "current"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let parameters = at.place.parameters;
        for body in &self.bodies {
            let s = self.streamed(body.body, at);
            let wrench = parameters.density() * stream_wrench(&body.added, &s.nu, &s.stream);
            out.wrenches[body.body] += s.pose.wrench_to_world(&wrench);
        }
        for displaced in &self.displaced {
            let s = self.streamed(displaced.body, at);
            let center = displaced.point.at(parameters);
            let wrench = mass(displaced, parameters) * pressed(&center, &s.stream);
            out.wrenches[displaced.body] += s.pose.wrench_to_world(&wrench);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        let still = Stream {
            velocity: Vec3::zeros(),
            acceleration: Vec3::zeros(),
        };
        for body in &self.bodies {
            let s = self.streamed(body.body, at);
            let dnu = s.pose.twist_to_body(&change.twists[body.body]);
            let unit = stream_wrench_jvp(&body.added, &s.nu, &s.stream, &dnu, &still);
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
            let unit = stream_wrench(&body.added, &s.nu, &s.stream);
            bar.parameters[DENSITY] += zeta.dot(&unit);
            let made = stream_wrench_vjp(&body.added, &s.nu, &s.stream, &(density * zeta));
            let nu_bar = s.pose.wrench_to_world(&made.nu);
            bar.twist[b] += nu_bar;
            bar.pose[b] -= cross_force(&s.past, &nu_bar);
            let wrench = s.pose.wrench_to_world(&(density * unit));
            self.add_stream_bar(b, (at, &s), (virt, &wrench), &made.stream, bar);
        }
        for displaced in &self.displaced {
            let b = displaced.body;
            let virt = &z.twists[b];
            if *virt == Vec6::zeros() {
                continue;
            }
            let s = self.streamed(b, at);
            let zeta = s.pose.twist_to_body(virt);
            let (mass, center) = (mass(displaced, parameters), displaced.point.at(parameters));
            let unit = pressed(&center, &s.stream);
            let along = zeta.dot(&unit);
            bar.parameters[DENSITY] += parameters[displaced.volume] * along;
            bar.parameters[displaced.volume] += density * along;
            let center_bar = mass * s.stream.acceleration.cross(&angular(&zeta));
            displaced.point.add(&center_bar, bar.parameters);
            let stream_bar = Stream {
                velocity: Vec3::zeros(),
                acceleration: mass * (linear(&zeta) + angular(&zeta).cross(&center)),
            };
            let wrench = s.pose.wrench_to_world(&(mass * unit));
            self.add_stream_bar(b, (at, &s), (virt, &wrench), &stream_bar, bar);
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, parameters: &Parameters) -> Outside {
        let mut each = (self.bodies.iter().map(|body| body.body))
            .chain(self.displaced.iter().map(|displaced| displaced.body));
        let held = each.any(|b| group.holds(b));
        match held && !self.streams.rest(parameters) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.streams.rest(parameters)
    }
}
