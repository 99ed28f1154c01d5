//! Weight of the bodies' masses: m g at the centre of mass.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Place, Velocity};
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::Declarations;

struct Gravity {
    /// g, m/s².
    acceleration: Vec3,
    /// Centre of mass of each body in its frame, m.
    centers: Vec<Vec3>,
}

pub(super) fn assemble(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let acceleration = Vec3::from(parts.scene.gravity);
    let centers = parts.bodies.iter().map(|b| b.center_of_mass).collect();
    (acceleration != Vec3::zeros()).then(|| {
        Box::new(Gravity {
            acceleration,
            centers,
        }) as Box<dyn ForceModel>
    })
}

impl ForceModel for Gravity {
    fn name(&self) -> &'static str {
        "gravity"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for (b, center) in self.centers.iter().enumerate() {
            let x = at.place.poses[b].apply(center);
            out.wrenches[b] += point_wrench(&x, &(at.place.parameters.mass(b) * self.acceleration));
        }
    }

    fn jvp(&self, _: &Moving, _: &Velocity, _: &mut Loads) {}

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for (b, center) in self.centers.iter().enumerate() {
            let x = at.place.poses[b].apply(center);
            let force = at.place.parameters.mass(b) * self.acceleration;
            bar.pose[b] += point_wrench(&x, &force.cross(&angular(&z.twists[b])));
            *bar.parameters.mass_mut(b) += self.acceleration.dot(&point_velocity(&z.twists[b], &x));
        }
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |(b, center): (usize, &Vec3)| {
            let x = place.poses[b].apply(center);
            -place.parameters.mass(b) * self.acceleration.dot(&x)
        };
        self.centers.iter().enumerate().map(of).sum()
    }
}
