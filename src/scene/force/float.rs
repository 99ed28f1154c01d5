//! Floats and ballast.

use super::super::is_default;
use super::{Force, Scene, number};
use crate::Result;
use serde::{Deserialize, Serialize};

/// Foam or ballast at a point of a body: a volume, by which the body is buoyant there, and a mass. The water doesn't feel it otherwise.
///
/// Its mass is part of the body's: mass, centre of mass and inertia of the body, and the parameters of these names, are those of both.
///
/// ```
/// use hydrograd::scene::{Body, Float, Fluid, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.1)).named("rov").density(1100.0));
/// scene.add_force(Float::new("rov").at([0.0, 0.0, 0.08]).volume(5e-4).mass(0.1).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Float {
    /// Name, unique in the scene; default: "float" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body.
    pub body: String,
    /// Where it is in the body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// Volume, m³.
    #[serde(default, skip_serializing_if = "is_default")]
    pub volume: f64,
    /// Mass, kg.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mass: f64,
}

impl Float {
    /// At a body's origin; it still needs a volume or a mass.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ..Self::default()
        }
    }
}

setters! { Float {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// Where it is in the body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// Volume, m³.
    volume(volume: f64) => volume = volume;
    /// Mass, kg.
    mass(mass: f64) => mass = mass;
} }

impl From<Float> for Force {
    fn from(float: Float) -> Self {
        Force::Float(float)
    }
}

impl Scene {
    /// The floats among the forces.
    pub(crate) fn floats(&self) -> impl Iterator<Item = &Float> {
        self.forces.iter().filter_map(|force| match force {
            Force::Float(float) => Some(float),
            _ => None,
        })
    }
}

impl Float {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        for x in self.at {
            number(place("at"), x, true, "give finite numbers, in m")?;
        }
        number(
            place("volume"),
            self.volume,
            false,
            "give zero or more, in m³",
        )?;
        number(place("mass"), self.mass, false, "give zero or more, in kg")
    }
}
