//! Forces between bodies as a scene gives them, one file each.

mod current;
mod damping;
mod edge;
mod fin;
mod float;
mod lubrication;
mod spring;
mod tendon;
mod thruster;

pub use current::Current;
pub(crate) use damping::{AXES, least_damping};
pub use damping::{Coefficients, Damping};
pub use edge::Edge;
pub use fin::Fin;
pub use float::Float;
pub use lubrication::{Lubrication, WATER_VISCOSITY};
pub use spring::Spring;
pub use tendon::Tendon;
pub use thruster::Thruster;

use super::{BodyId, Scene};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A force between bodies, or between bodies and the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Force {
    /// Along the line between two points.
    Spring(Spring),
    /// Viscous water in thin gaps.
    Lubrication(Lubrication),
    /// Of a body, by matrices.
    Damping(Damping),
    /// Of a thruster of a body.
    Thruster(Thruster),
    /// Lift and drag of a fin.
    Fin(Fin),
    /// Of foam or ballast at a point.
    Float(Float),
    /// Of a trailing edge.
    Edge(Edge),
    /// Of a tendon over joints.
    Tendon(Tendon),
    /// Of water that streams past, by depth and time.
    Current(Current),
}

/// Why there is no float in water with a surface.
pub(crate) const BUOYANT_ANYWHERE: &str =
    "a float is buoyant at any height: in water with a `waterline` give a body a shape instead";

/// The forces of a kind, each with its number among all.
macro_rules! kinds {
    ($($name:ident: $kind:ident),*) => {
        impl Scene {
            $(pub(crate) fn $name(&self) -> impl Iterator<Item = (usize, &$kind)> {
                let each = self.forces.iter().enumerate();
                each.filter_map(|(i, force)| match force {
                    Force::$kind(of) => Some((i, of)),
                    _ => None,
                })
            })*
        }
    };
}
kinds!(currents: Current, edges: Edge, fins: Fin, lubrications: Lubrication, all_tendons: Tendon, all_thrusters: Thruster);

/// Forces with controls, which are numbered on from `first`: their numbers, their controls, and themselves.
fn numbered<'a, F: 'a>(
    first: usize,
    each: impl Iterator<Item = (usize, &'a F)>,
) -> impl Iterator<Item = (usize, usize, &'a F)> {
    each.enumerate()
        .map(move |(k, (i, force))| (i, first + k, force))
}

impl Scene {
    /// The thrusters, each with its number among all forces and its control: they come after those of bodies.
    pub(crate) fn thrusters(&self) -> impl Iterator<Item = (usize, usize, &Thruster)> {
        numbered(self.body_controls(), self.all_thrusters())
    }

    /// The tendons, each with its number among all forces and its control: they come after those of thrusters.
    pub(crate) fn tendons(&self) -> impl Iterator<Item = (usize, usize, &Tendon)> {
        let first = self.body_controls() + self.all_thrusters().count();
        numbered(first, self.all_tendons())
    }

    /// Against gravity, or along z where there is none: a unit vector.
    pub(crate) fn up(&self) -> [f64; 3] {
        match self.gravity {
            [0.0, 0.0, 0.0] => [0.0, 0.0, 1.0],
            gravity => unit(gravity.map(|g| -g)),
        }
    }

    /// Adds a force between bodies.
    pub fn add_force(&mut self, force: Force) {
        self.forces.push(force);
    }

    /// Name of force number `index`, which its parameters begin with: its own, or its kind and number, counted from 1.
    pub fn force_name(&self, index: usize) -> String {
        let (kind, name) = match &self.forces[index] {
            Force::Spring(spring) => ("spring", &spring.name),
            Force::Lubrication(lubrication) => ("lubrication", &lubrication.name),
            Force::Damping(damping) => ("damping", &damping.name),
            Force::Thruster(thruster) => ("thruster", &thruster.name),
            Force::Fin(fin) => ("fin", &fin.name),
            Force::Float(float) => ("float", &float.name),
            Force::Edge(edge) => ("edge", &edge.name),
            Force::Tendon(tendon) => ("tendon", &tendon.name),
            Force::Current(current) => ("current", &current.name),
        };
        let counted = || format!("{kind} {}", index + 1);
        name.clone().unwrap_or_else(counted)
    }

    /// Checks the forces, once the bodies are known to be right.
    pub(super) fn check_forces(&self) -> Result<()> {
        let mut taken: Vec<String> = ["fluid", "contact"].map(String::from).into();
        taken.extend(self.bodies.iter().map(|b| b.name.clone()));
        for (i, force) in self.forces.iter().enumerate() {
            let place = |field: &str| format!("forces[{i}].{field}");
            let name = self.force_name(i);
            if name.trim().is_empty() || taken.contains(&name) {
                return Err(Error::input(
                    place("name"),
                    format!("{name:?}"),
                    "give a name that no body and no other force has; its parameters begin with it",
                ));
            }
            taken.push(name);
            match force {
                Force::Spring(spring) => spring.check(self, &place)?,
                Force::Lubrication(lubrication) => lubrication.check(self, &place)?,
                Force::Damping(damping) => damping.check(self, &place)?,
                Force::Thruster(thruster) => thruster.check(self, &place)?,
                Force::Fin(fin) => fin.check(self, &place)?,
                Force::Float(float) if self.waterline.is_some() && float.volume > 0.0 => {
                    return Err(Error::input(
                        place("volume"),
                        float.volume,
                        BUOYANT_ANYWHERE,
                    ));
                }
                Force::Float(float) => float.check(self, &place)?,
                Force::Edge(edge) => edge.check(self, &place)?,
                Force::Tendon(tendon) => tendon.check(self, &place)?,
                Force::Current(current) => current.check(self, &place)?,
            }
        }
        Ok(())
    }

    /// The body that a force names.
    pub(super) fn named_body(&self, name: &str, place: String) -> Result<BodyId> {
        self.body(name).ok_or_else(|| {
            let names: Vec<&str> = self.bodies.iter().map(|b| b.name.as_str()).collect();
            let remedy = match self.sites.iter().find(|site| site.name == name) {
                Some(site) => format!(
                    "it is a site: name its body, {:?}, and give places and directions in that one's frame (the site is at {:?} m there, turned by {:?} rad)",
                    site.body, site.placement.position, site.placement.rotation
                ),
                None => format!("no body has that name; the bodies are {}", names.join(", ")),
            };
            Error::input(place, format!("{name:?}"), remedy)
        })
    }
}

/// Refuses what isn't finite, or is negative where it may not be.
fn number(place: String, value: f64, negative: bool, remedy: &str) -> Result<()> {
    match value.is_finite() && (negative || value >= 0.0) {
        true => Ok(()),
        false => Err(Error::input(place, value, remedy)),
    }
}

/// Refuses what isn't a direction.
fn direction(place: String, given: [f64; 3]) -> Result<()> {
    match given.iter().all(|x| x.is_finite()) && given != [0.0; 3] {
        true => Ok(()),
        false => Err(Error::input(
            place,
            format!("{given:?}"),
            "give a direction: finite numbers, not all zero",
        )),
    }
}

/// A direction of length one.
fn unit(direction: [f64; 3]) -> [f64; 3] {
    let largest = direction.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let scaled = direction.map(|x| x / largest);
    let length = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
    scaled.map(|x| x / length)
}

/// Largest cosine of an angle that counts as right.
const SQUARE: f64 = 1e-6;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(&b).map(|(x, y)| x * y).sum()
}

/// Directions of length one, the second at a right angle to the first.
fn square(first: [f64; 3], second: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let (first, second) = (unit(first), unit(second));
    let along = dot(first, second);
    let across = std::array::from_fn(|k| second[k] - along * first[k]);
    (first, unit(across))
}

/// Refuses a direction that isn't at a right angle to another, of which `name` tells.
fn across(place: String, first: [f64; 3], second: [f64; 3], name: &str) -> Result<()> {
    let cosine = dot(unit(first), unit(second));
    match cosine.abs() <= SQUARE {
        true => Ok(()),
        false => Err(Error::input(
            place,
            format!("{second:?}, whose angle with {name} has the cosine {cosine:.3e}"),
            format!("give a direction at a right angle to {name}"),
        )),
    }
}
