//! Forces between bodies as a scene gives them, one file each.

mod lubrication;
mod spring;

pub use lubrication::{Lubrication, WATER_VISCOSITY};
pub use spring::Spring;

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
}

impl Scene {
    /// Adds a force between bodies.
    pub fn add_force(&mut self, force: Force) {
        self.forces.push(force);
    }

    /// Name of force number `index`, which its parameters begin with: its own, or its kind and number, counted from 1.
    pub fn force_name(&self, index: usize) -> String {
        let (kind, name) = match &self.forces[index] {
            Force::Spring(spring) => ("spring", &spring.name),
            Force::Lubrication(lubrication) => ("lubrication", &lubrication.name),
        };
        let counted = || format!("{kind} {}", index + 1);
        name.clone().unwrap_or_else(counted)
    }

    /// The forces of viscous water, each with its number among all.
    pub(crate) fn lubrications(&self) -> impl Iterator<Item = (usize, &Lubrication)> {
        let each = self.forces.iter().enumerate();
        each.filter_map(|(i, force)| match force {
            Force::Lubrication(lubrication) => Some((i, lubrication)),
            Force::Spring(_) => None,
        })
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
            }
        }
        Ok(())
    }

    /// The body that a force names.
    pub(super) fn named_body(&self, name: &str, place: String) -> Result<BodyId> {
        self.body(name).ok_or_else(|| {
            let names: Vec<&str> = self.bodies.iter().map(|b| b.name.as_str()).collect();
            let remedy = format!("no body has that name; the bodies are {}", names.join(", "));
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
