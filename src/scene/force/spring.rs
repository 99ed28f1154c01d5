//! Linear springs with dampers.

use super::super::is_default;
use super::{Force, Scene, number};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A linear spring, with a damper beside it, between a point of a body and a point of another one or of the world: it pulls the points
/// together with `stiffness · (length − rest_length) + damping · (rate of the length)`.
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Scene, Shape, Spring};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.1)).named("buoy").density(500.0));
/// scene.add_force(Spring::new("buoy").anchored([0.0, 0.0, -2.0]).stiffness(40.0).rest_length(1.5).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Name, unique in the scene; default: "spring" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body at its first end.
    pub body: String,
    /// First end in that body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// Name of the body at its second end; default: the world.
    pub to: Option<String>,
    /// Second end in that body's frame, or in the world, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub to_at: [f64; 3],
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Length at which it doesn't pull, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rest_length: f64,
    /// Damping of the length's rate, N s/m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub damping: f64,
}

impl Spring {
    /// A spring from the origin of a body to the world's; it still needs a stiffness.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ..Self::default()
        }
    }

    /// Second end at a point (m, its frame) of a body.
    pub fn to(mut self, body: impl Into<String>, point: [f64; 3]) -> Self {
        (self.to, self.to_at) = (Some(body.into()), point);
        self
    }

    /// Second end at a point of the world, m.
    pub fn anchored(mut self, point: [f64; 3]) -> Self {
        (self.to, self.to_at) = (None, point);
        self
    }
}

setters! { Spring {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// First end in its body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// Stiffness, N/m.
    stiffness(stiffness: f64) => stiffness = stiffness;
    /// Length at which it doesn't pull, m.
    rest_length(length: f64) => rest_length = length;
    /// Damping, N s/m.
    damping(damping: f64) => damping = damping;
} }

impl From<Spring> for Force {
    fn from(spring: Spring) -> Self {
        Force::Spring(spring)
    }
}

impl Spring {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        if let Some(to) = &self.to {
            scene.named_body(to, place("to"))?;
            if *to == self.body {
                return Err(Error::input(
                    place("to"),
                    format!("{to:?}"),
                    "a spring within one rigid body does nothing; name another body, or leave it out for the world",
                ));
            }
        }
        for (field, point) in [("at", self.at), ("to_at", self.to_at)] {
            for x in point {
                number(place(field), x, true, "give finite numbers, in m")?;
            }
        }
        let numbers = [
            ("stiffness", self.stiffness, "N/m"),
            ("rest_length", self.rest_length, "m"),
            ("damping", self.damping, "N s/m"),
        ];
        numbers.into_iter().try_for_each(|(field, x, unit)| {
            let remedy = format!("give zero or more, in {unit}");
            number(place(field), x, false, &remedy)
        })
    }
}
