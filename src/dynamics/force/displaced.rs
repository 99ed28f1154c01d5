//! What bodies displace, and where: they themselves at their centres of buoyancy, and floats.

use super::ForceParts;
use crate::adjoint::lie::Vec3;
use crate::dynamics::Parameters;
use crate::dynamics::parameters::{
    Declarations, Declared, Owner, Parameter, Range, center_of_buoyancy, volume,
};
use crate::scene::{BUOYANT_ANYWHERE, Force};

/// Of a float.
const VOLUME: Declared = Declared::new("volume", "m³");
/// Under a surface, where a scene refuses it too.
const NO_VOLUME: Declared = VOLUME.range(Range::Zero(BUOYANT_ANYWHERE));

/// A point in a body's frame, m.
#[derive(Clone, Copy)]
pub(super) enum Point {
    /// Whose coordinates are parameters.
    Free([Parameter; 3]),
    Fixed(Vec3),
}

/// A volume of a body.
#[derive(Clone, Copy)]
pub(super) struct Displaced {
    pub body: usize,
    pub volume: Parameter,
    pub point: Point,
}

impl Point {
    pub fn at(&self, parameters: &Parameters) -> Vec3 {
        match self {
            Point::Free(at) => parameters.point(*at),
            Point::Fixed(at) => *at,
        }
    }

    /// Adds a cotangent of it, body's frame, to its parameters, if it has any.
    pub fn add(&self, bar: &Vec3, parameters: &mut Parameters) {
        if let Point::Free(point) = self {
            parameters.add_point(*point, bar);
        }
    }
}

/// What bodies displace themselves.
pub(super) fn of_bodies(parts: &ForceParts) -> Vec<Displaced> {
    let bodies = parts.bodies.iter().zip(&parts.scene.bodies).enumerate();
    let displacing = bodies.filter(|(_, (b, given))| b.volume > 0.0 || given.volume.is_some());
    let each = displacing.map(|(body, _)| Displaced {
        body,
        volume: volume(body),
        point: Point::Free(center_of_buoyancy(body)),
    });
    each.collect()
}

/// What floats displace; their volumes are declared by who asks first.
pub(super) fn of_floats(parts: &ForceParts, parameters: &mut Declarations) -> Vec<Displaced> {
    let declared = match parts.waterline {
        Some(_) => NO_VOLUME,
        None => VOLUME,
    };
    let floats = parts.scene.forces.iter().enumerate();
    let each = floats.filter_map(|(i, force)| {
        let Force::Float(given) = force else {
            return None;
        };
        let owner = Owner::Named(parts.scene.force_name(i));
        Some(Displaced {
            body: parts.scene.body(&given.body).map_or(0, |b| b.0),
            volume: parameters.declare_once(owner, declared, given.volume),
            point: Point::Fixed(given.at.into()),
        })
    });
    each.collect()
}
