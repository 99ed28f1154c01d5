//! Viscous water that is squeezed out between surfaces.

use super::super::is_default;
use super::{Force, Scene, number};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Viscosity of water at 20 °C, Pa·s.
pub const WATER_VISCOSITY: f64 = 1.0016e-3;

/// The viscosity of the water in gaps between bodies, and between bodies and walls: a damper by Reynolds' lubrication, solved together with contact at the end of a
/// step (`docs/lubrication.md`). It acts between all surfaces that move against one another but those of a body and the one that carries it.
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Lubrication, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.01)).named("ball").density(2000.0).at([0.0, 0.0, 0.011]));
/// scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
/// scene.add_force(Lubrication::new(1e-6).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lubrication {
    /// Name, unique in the scene; default: "lubrication" and its number among the forces.
    pub name: Option<String>,
    /// Dynamic viscosity, Pa·s; default: that of water at 20 °C.
    #[serde(default = "water")]
    pub viscosity: f64,
    /// Roughness of the surfaces, m: they touch at its tips, and the water is as thick as their distance and it.
    pub roughness: f64,
    /// Names of bodies: it acts in their gaps alone; empty: in all.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bodies: Vec<String>,
    /// Distance of the surfaces at which the pressure has fallen to that in the open, m; default: the radius of the ball around the smaller body.
    pub reach: Option<f64>,
}

fn water() -> f64 {
    WATER_VISCOSITY
}

impl Lubrication {
    /// That of water between surfaces of this roughness, m.
    pub fn new(roughness: f64) -> Self {
        Self {
            name: None,
            viscosity: WATER_VISCOSITY,
            roughness,
            bodies: Vec::new(),
            reach: None,
        }
    }

    /// Only in the gaps of these bodies.
    pub fn of<N: Into<String>>(mut self, bodies: impl IntoIterator<Item = N>) -> Self {
        self.bodies = bodies.into_iter().map(Into::into).collect();
        self
    }

    /// Whether it acts in the gaps of one of these bodies.
    pub(crate) fn acts_between(&self, names: &[&str]) -> bool {
        self.bodies.is_empty() || names.iter().any(|n| self.bodies.iter().any(|b| b == n))
    }
}

setters! { Lubrication {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// Dynamic viscosity, Pa·s.
    viscosity(viscosity: f64) => viscosity = viscosity;
    /// Distance at which the pressure has fallen to that in the open, m.
    reach(reach: f64) => reach = Some(reach);
} }

impl From<Lubrication> for Force {
    fn from(lubrication: Lubrication) -> Self {
        Force::Lubrication(lubrication)
    }
}

impl Lubrication {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        for name in &self.bodies {
            let body = scene.named_body(name, place("bodies"))?;
            if scene.bodies[body.0].shape.is_none() {
                return Err(Error::input(
                    place("bodies"),
                    format!("{name:?}"),
                    "it has no shape, and so no gaps; name bodies that have one",
                ));
            }
        }
        number(
            place("viscosity"),
            self.viscosity,
            false,
            "give zero or more, in Pa·s; that of water is 1e-3",
        )?;
        let lengths = [("roughness", Some(self.roughness)), ("reach", self.reach)];
        for (field, length) in lengths {
            let Some(length) = length else { continue };
            if !(length > 0.0 && length.is_finite()) {
                return Err(Error::input(
                    place(field),
                    length,
                    "give a length above zero, in m",
                ));
            }
        }
        Ok(())
    }
}
