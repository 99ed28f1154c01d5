//! Named frames on bodies: where one looks, measures or aims at.

use super::{BodyId, Placement, Scene};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A named frame on a body, of which rollouts tell position, orientation and velocity (`site_positions`, `site_rotations`, `site_attitudes`, `site_velocities`, `site_gyros`, `site_accelerations`).
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Scene, Shape, Site};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.1)).named("buoy").density(500.0));
/// scene.add_site(Site::new("mast", "buoy").at([0.0, 0.0, 0.3]));
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Name, unique among sites and bodies.
    pub name: String,
    /// Name of the body that it is fixed to.
    pub body: String,
    /// Its pose in the body's frame.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub placement: Placement,
}

impl Site {
    /// The frame of a body.
    pub fn new(name: impl Into<String>, body: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            body: body.into(),
            placement: Placement::default(),
        }
    }
}

setters! { Site {
    /// Origin in the body's frame, m.
    at(position: [f64; 3]) => placement.position = position;
    /// Rotation vector of its axes in the body's frame, rad.
    rotated(rotation: [f64; 3]) => placement.rotation = rotation;
} }

impl Scene {
    /// Adds a site and gives its number.
    pub fn add_site(&mut self, site: Site) -> usize {
        self.sites.push(site);
        self.sites.len() - 1
    }

    /// The body that a site is fixed to. The sites must have been checked.
    pub(crate) fn site_body(&self, site: &Site) -> Option<BodyId> {
        self.body(&site.body)
    }

    /// Checks the sites, once the bodies are known to be right.
    pub(super) fn check_sites(&self) -> Result<()> {
        for (i, site) in self.sites.iter().enumerate() {
            let place = |field: &str| format!("sites[{i}].{field}");
            let name = site.name.trim();
            let taken = self.sites[..i].iter().any(|s| s.name == site.name);
            if name.is_empty() || taken || self.body(name).is_some() {
                return Err(Error::input(
                    place("name"),
                    format!("{:?}", site.name),
                    "give each site a name that no other and no body has",
                ));
            }
            self.named_body(&site.body, place("body"))?;
            let Placement { position, rotation } = &site.placement;
            super::validate::finite(&place("placement.position"), position)?;
            super::validate::rotation(&place("placement.rotation"), rotation)?;
        }
        Ok(())
    }
}
