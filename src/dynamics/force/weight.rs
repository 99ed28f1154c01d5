//! Forces at points of bodies by gravity: weight, m g at the centre of mass, and buoyancy, −ρ V g at the centre of buoyancy, of bodies and of floats.

use super::displaced::{Displaced, Point, of_bodies, of_floats};
use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Together, Velocity};
use crate::adjoint::lie::{Vec3, angular, point_velocity, point_wrench};
use crate::dynamics::parameters::{
    DENSITY, Declarations, Parameter, Parameters, center_of_mass, mass,
};

struct Weight {
    name: &'static str,
    /// m/s²: g, or −g.
    acceleration: Vec3,
    parcels: Vec<Parcel>,
}

/// What is accelerated at a point of a body.
struct Parcel {
    body: usize,
    point: Point,
    /// Its mass, or the density of what is displaced.
    of: Parameter,
    /// The volume of what is displaced.
    volume: Option<Parameter>,
}

impl From<Displaced> for Parcel {
    fn from(displaced: Displaced) -> Self {
        Self {
            body: displaced.body,
            point: displaced.point,
            of: DENSITY,
            volume: Some(displaced.volume),
        }
    }
}

pub(super) fn gravity(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let parcels = (0..parts.bodies.len()).map(|body| Parcel {
        body,
        point: Point::Free(center_of_mass(body)),
        of: mass(body),
        volume: None,
    });
    let acceleration = Vec3::from(parts.scene.gravity);
    let acts = acceleration != Vec3::zeros();
    acts.then(|| assemble("gravity", acceleration, parcels.collect()))?
}

/// Where the water has no end.
pub(super) fn buoyancy(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    if parts.waterline.is_some() {
        return None;
    }
    let parcels = of_bodies(parts).into_iter().map(Parcel::from);
    let acceleration = -Vec3::from(parts.scene.gravity);
    let acts = acceleration != Vec3::zeros();
    acts.then(|| assemble("buoyancy", acceleration, parcels.collect()))?
}

/// Of floats, the volumes; what they weigh is part of their bodies.
pub(super) fn floats(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let parcels = of_floats(parts, parameters).into_iter().map(Parcel::from);
    // Without gravity, too: their volumes are parameters, and tell where the centre of buoyancy is.
    assemble("float", -Vec3::from(parts.scene.gravity), parcels.collect())
}

fn assemble(
    name: &'static str,
    acceleration: Vec3,
    parcels: Vec<Parcel>,
) -> Option<Box<dyn ForceModel>> {
    (!parcels.is_empty()).then(|| {
        Box::new(Weight {
            name,
            acceleration,
            parcels,
        }) as Box<dyn ForceModel>
    })
}

impl Parcel {
    /// What of it the acceleration acts on, kg.
    fn mass(&self, parameters: &Parameters) -> f64 {
        parameters[self.of] * self.volume.map_or(1.0, |v| parameters[v])
    }
}

impl Weight {
    /// Where a parcel is, and the force on it.
    fn at(&self, p: &Parcel, place: &Place) -> (Vec3, Vec3) {
        let force = p.mass(place.parameters) * self.acceleration;
        (
            place.poses[p.body].apply(&p.point.at(place.parameters)),
            force,
        )
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
            let x_bar = force.cross(&angular(virt));
            bar.pose[p.body] += point_wrench(&x, &x_bar);
            let along = self.acceleration.dot(&point_velocity(virt, &x));
            match p.volume {
                None => bar.parameters[p.of] += along,
                Some(volume) => {
                    bar.parameters[p.of] += at.place.parameters[volume] * along;
                    bar.parameters[volume] += at.place.parameters[p.of] * along;
                }
            }
            let turned = at.place.poses[p.body].rotation.tr_mul(&x_bar);
            p.point.add(&turned, bar.parameters);
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let held = self.parcels.iter().any(|p| group.holds(p.body));
        match held && self.acceleration != Vec3::zeros() {
            true => Outside::Along(self.acceleration),
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, _: &Parameters) -> bool {
        true
    }

    fn displaced(&self, place: &Place) -> Vec<(f64, Vec3)> {
        let floats = self.parcels.iter().filter_map(|p| {
            let (Point::Fixed(at), Some(volume)) = (&p.point, p.volume) else {
                return None;
            };
            let volume = place.parameters[volume];
            Some((volume, volume * place.poses[p.body].apply(at)))
        });
        floats.collect()
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |p: &Parcel| {
            let (x, _) = self.at(p, place);
            -p.mass(place.parameters) * self.acceleration.dot(&x)
        };
        self.parcels.iter().map(of).sum()
    }
}
