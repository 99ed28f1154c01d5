//! The parameters that every system has: the fluid's density, what each body is, and contact. They are declared first, in this order, so that their places are known.

use super::declared::{Declared, Parameter, Range};
use crate::adjoint::lie::Vec3;

/// The fluid's density: declared before all others.
pub const DENSITY: Parameter = Parameter(0);

/// Mass of body `b`: after the density come the bodies, each with its mass, its inertia, its centre of mass, its volume and the centre of that.
pub fn mass(b: usize) -> Parameter {
    Parameter(1 + (1 + INERTIA.len() + CENTER.len() + 1 + BUOYANCY.len()) * b)
}

/// Inertia of body `b` about its centre of mass.
pub fn inertia(b: usize) -> [Parameter; 6] {
    std::array::from_fn(|k| Parameter(mass(b).0 + 1 + k))
}

/// Centre of mass of body `b`.
pub fn center_of_mass(b: usize) -> [Parameter; 3] {
    std::array::from_fn(|k| Parameter(mass(b).0 + 1 + INERTIA.len() + k))
}

/// Volume by which body `b` is buoyant.
pub fn volume(b: usize) -> Parameter {
    Parameter(center_of_mass(b)[2].0 + 1)
}

/// Centre of buoyancy of body `b`.
pub fn center_of_buoyancy(b: usize) -> [Parameter; 3] {
    std::array::from_fn(|k| Parameter(volume(b).0 + 1 + k))
}

/// All parameters of body `b`: mass, inertia, centre of mass, volume and the centre of that.
pub fn body_places(b: usize) -> [Parameter; 14] {
    std::array::from_fn(|k| Parameter(mass(b).0 + k))
}

/// Parameters of contact of so many bodies: after theirs.
pub fn contact(bodies: usize) -> [Parameter; CONTACT.len()] {
    std::array::from_fn(|k| Parameter(mass(bodies).0 + k))
}

pub const FLUID: Declared = Declared::new("density", "kg/m³");
pub const MASS: Declared = Declared::new("mass", "kg");
pub const CONTACT: [Declared; 5] = [
    Declared::new("stiffness", "N/m"),
    Declared::new("dissipation", "s/m"),
    Declared::new("friction", "1"),
    Declared::new("torsional_friction", "m"),
    Declared::new("rolling_friction", "m"),
];

/// A coordinate of a point; changes are a part of the largest body's size.
const fn coordinate(name: &'static str) -> Declared {
    Declared::new(name, "m")
        .range(Range::Finite)
        .size(|_, typical| 0.05 * typical.length)
}

pub const CENTER: [Declared; 3] = [
    coordinate("center_of_mass.x"),
    coordinate("center_of_mass.y"),
    coordinate("center_of_mass.z"),
];
pub const BUOYANCY: [Declared; 3] = [
    coordinate("center_of_buoyancy.x"),
    coordinate("center_of_buoyancy.y"),
    coordinate("center_of_buoyancy.z"),
];
pub const VOLUME: Declared = Declared::new("volume", "m³");
/// The same of a body that nothing is known to be displaced by.
pub const NO_VOLUME: Declared = VOLUME.range(Range::Zero(
    "must be 0 for a body whose scene gives neither shape nor volume; give it `volume` there, zero if need be",
));

/// What a body starts from.
#[derive(Clone, Debug)]
pub struct BodyValues {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Inertia about the centre of mass: xx, yy, zz, xy, xz, yz, kg m².
    pub inertia: [f64; 6],
    /// Centre of mass in the body's frame, m.
    pub center_of_mass: Vec3,
    /// Volume by which it is buoyant, m³, if it has one.
    pub volume: Option<f64>,
    /// Centre of that in the body's frame, m.
    pub center_of_buoyancy: Vec3,
}

/// Moments, then products.
pub const INERTIA: [Declared; 6] = {
    const fn product(name: &'static str) -> Declared {
        Declared::new(name, "kg m²")
            .range(Range::Finite)
            .size(|_, typical| 0.1 * typical.moment)
    }
    [
        Declared::new("inertia.xx", "kg m²"),
        Declared::new("inertia.yy", "kg m²"),
        Declared::new("inertia.zz", "kg m²"),
        product("inertia.xy"),
        product("inertia.xz"),
        product("inertia.yz"),
    ]
};
