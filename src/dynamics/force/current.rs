//! The inertia of water whose own velocity changes: what a body feels of its added mass in a stream by depth and time, and of the pressure that accelerates the stream.
//!
//! The body's own added mass alone has part in it ([`crate::adjoint::stream`]): in bodies that feel each other, and at walls, the water's answer to the stream is that of each alone.

use super::stream::{Streams, Undisturbed};
use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, angular, cross_force, linear, six};
use crate::adjoint::stream::{Stream, stream_wrench, stream_wrench_jvp, stream_wrench_vjp};
use crate::dynamics::Parameters;
use crate::dynamics::parameters::{DENSITY, Declarations, Parameter, center_of_buoyancy, volume};
use std::sync::Arc;

struct Carried {
    bodies: Vec<Body>,
    streams: Arc<Streams>,
}

struct Body {
    body: usize,
    /// Its own added mass at unit density, body's frame, about its origin.
    added: Mat6,
    volume: Parameter,
    center: [Parameter; 3],
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

pub(super) fn assemble(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let body = |(body, added): &(usize, Mat6)| Body {
        body: *body,
        added: *added,
        volume: volume(*body),
        center: center_of_buoyancy(*body),
    };
    let bodies: Vec<Body> = parts.added_mass.iter().map(body).collect();
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

impl Body {
    /// The wrench of a pressure that accelerates the water, per mass of what is displaced.
    fn pressed(&self, stream: &Stream, parameters: &Parameters) -> Vec6 {
        let center = parameters.point(self.center);
        six(&stream.acceleration, &center.cross(&stream.acceleration))
    }

    /// The wrench at unit density, body's frame.
    fn unit(&self, at: &Streamed, parameters: &Parameters) -> Vec6 {
        stream_wrench(&self.added, &at.nu, &at.stream)
            + parameters[self.volume] * self.pressed(&at.stream, parameters)
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
            let unit = body.unit(&s, parameters);
            let displaced = density * parameters[body.volume];
            let along = zeta.dot(&body.pressed(&s.stream, parameters));
            bar.parameters[DENSITY] += zeta.dot(&unit);
            bar.parameters[body.volume] += density * along;
            let center_bar = displaced * s.stream.acceleration.cross(&angular(&zeta));
            bar.parameters.add_point(body.center, &center_bar);

            let made = stream_wrench_vjp(&body.added, &s.nu, &s.stream, &(density * zeta));
            let center = parameters.point(body.center);
            let pushed = displaced * (linear(&zeta) + angular(&zeta).cross(&center));
            let world = |x: &Vec3| s.pose.rotation * x;
            let water_bar = Undisturbed {
                velocity: world(&made.stream.velocity),
                acceleration: world(&(made.stream.acceleration + pushed)),
            };
            let nu_bar = s.pose.wrench_to_world(&made.nu);
            let wrench = s.pose.wrench_to_world(&(density * unit));
            bar.twist[b] += nu_bar;
            // The rotation of the frame acts on both twists, and on what is known of the water.
            bar.pose[b] -= cross_force(&s.past, &nu_bar) + cross_force(virt, &wrench);
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
