//! Buoyancy: −ρ V g at the centroid of the displaced volume.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Place, Velocity};
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::Declarations;

struct Buoyancy {
    /// −g, m/s².
    lift: Vec3,
    bodies: Vec<Displaced>,
}

/// What a body displaces.
struct Displaced {
    body: usize,
    /// m³.
    volume: f64,
    /// In the body's frame, m.
    centroid: Vec3,
}

pub(super) fn assemble(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let lift = -Vec3::from(parts.scene.gravity);
    let each = parts.bodies.iter().enumerate();
    let bodies: Vec<Displaced> = each
        .filter(|(_, b)| b.volume > 0.0)
        .map(|(body, b)| Displaced {
            body,
            volume: b.volume,
            centroid: b.centroid,
        })
        .collect();
    (lift != Vec3::zeros() && !bodies.is_empty())
        .then(|| Box::new(Buoyancy { lift, bodies }) as Box<dyn ForceModel>)
}

impl ForceModel for Buoyancy {
    fn name(&self) -> &'static str {
        "buoyancy"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let density = at.place.parameters.density();
        for d in &self.bodies {
            let x = at.place.poses[d.body].apply(&d.centroid);
            out.wrenches[d.body] += point_wrench(&x, &(density * d.volume * self.lift));
        }
    }

    fn jvp(&self, _: &Moving, _: &Velocity, _: &mut Loads) {}

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let density = at.place.parameters.density();
        for d in &self.bodies {
            let x = at.place.poses[d.body].apply(&d.centroid);
            let virt = &z.twists[d.body];
            let force = density * d.volume * self.lift;
            bar.pose[d.body] += point_wrench(&x, &force.cross(&angular(virt)));
            *bar.parameters.density_mut() += d.volume * self.lift.dot(&point_velocity(virt, &x));
        }
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |d: &Displaced| {
            let x = place.poses[d.body].apply(&d.centroid);
            -place.parameters.density() * d.volume * self.lift.dot(&x)
        };
        self.bodies.iter().map(of).sum()
    }
}
