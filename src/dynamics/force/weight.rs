//! Forces at points of bodies by gravity: weight, m g at the centre of mass, and buoyancy, −ρ V g at the centroid of the displaced volume.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Together, Velocity};
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::parameters::{DENSITY, Declarations, Parameter, Parameters, mass};

struct Weight {
    name: &'static str,
    /// m/s²: g, or −g.
    acceleration: Vec3,
    parcels: Vec<Parcel>,
}

/// What is accelerated at a point of a body.
struct Parcel {
    body: usize,
    /// In the body's frame, m.
    point: Vec3,
    /// Its mass, or the density of what is displaced.
    of: Parameter,
    /// m³, of what is displaced; 1 where `of` is the mass itself.
    volume: f64,
}

pub(super) fn gravity(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let parcels = parts.bodies.iter().enumerate().map(|(body, b)| Parcel {
        body,
        point: b.center_of_mass,
        of: mass(body),
        volume: 1.0,
    });
    assemble("gravity", parts.scene.gravity.into(), parcels.collect())
}

/// Where the water has no end.
pub(super) fn buoyancy(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    if parts.waterline.is_some() {
        return None;
    }
    let each = parts.bodies.iter().enumerate();
    let parcels = each
        .filter(|(_, b)| b.volume > 0.0)
        .map(|(body, b)| Parcel {
            body,
            point: b.centroid,
            of: DENSITY,
            volume: b.volume,
        });
    let acceleration = -Vec3::from(parts.scene.gravity);
    assemble("buoyancy", acceleration, parcels.collect())
}

fn assemble(
    name: &'static str,
    acceleration: Vec3,
    parcels: Vec<Parcel>,
) -> Option<Box<dyn ForceModel>> {
    (acceleration != Vec3::zeros() && !parcels.is_empty()).then(|| {
        Box::new(Weight {
            name,
            acceleration,
            parcels,
        }) as Box<dyn ForceModel>
    })
}

impl Weight {
    /// Where a parcel is, and the force on it.
    fn at(&self, p: &Parcel, place: &Place) -> (Vec3, Vec3) {
        let force = place.parameters[p.of] * p.volume * self.acceleration;
        (place.poses[p.body].apply(&p.point), force)
    }
}

impl ForceModel for Weight {
    fn name(&self) -> &'static str {
        self.name
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for p in &self.parcels {
            let (x, force) = self.at(p, &at.place);
            out.wrenches[p.body] += point_wrench(&x, &force);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for p in &self.parcels {
            let (x, force) = self.at(p, &at.place);
            let virt = &z.twists[p.body];
            bar.pose[p.body] += point_wrench(&x, &force.cross(&angular(virt)));
            bar.parameters[p.of] += p.volume * self.acceleration.dot(&point_velocity(virt, &x));
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        match self.parcels.iter().any(|p| group.holds(p.body)) {
            true => Outside::Along(self.acceleration),
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, _: &Parameters) -> bool {
        true
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |p: &Parcel| {
            let (x, _) = self.at(p, place);
            -place.parameters[p.of] * p.volume * self.acceleration.dot(&x)
        };
        self.parcels.iter().map(of).sum()
    }
}
