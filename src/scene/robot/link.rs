//! What is chosen for single links of a robot.

use crate::robot::Wet;
use crate::scene::{Body, Drag, is_default};
use serde::{Deserialize, Serialize};

/// What is chosen for a link of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotLink {
    /// What the water sees of it; default: the robot's `shape`.
    #[serde(skip_serializing_if = "is_default")]
    pub shape: Option<Wet>,
    /// Mass instead of the file's, kg; the inertia grows with it.
    #[serde(skip_serializing_if = "is_default")]
    pub mass: Option<f64>,
    /// Density of the body that the link's frame and name are of, kg/m³: mass, centre and inertia are those of its surface filled evenly.
    #[serde(skip_serializing_if = "is_default")]
    pub density: Option<f64>,
    /// Whether it stays a body of its own at a fixed joint, instead of folding into what carries it.
    #[serde(skip_serializing_if = "is_default")]
    pub keep: bool,
    /// Centre of mass of the body that the link's frame and name are of, instead of the file's, m. This and what follows are as those of [`Body`].
    #[serde(skip_serializing_if = "is_default")]
    pub center_of_mass: Option<[f64; 3]>,
    /// Its inertia about the centre of mass, kg m²: xx, yy, zz or xx, yy, zz, xy, xz, yz.
    #[serde(skip_serializing_if = "is_default")]
    pub inertia: Option<Vec<f64>>,
    /// Volume by which it is buoyant, m³.
    #[serde(skip_serializing_if = "is_default")]
    pub volume: Option<f64>,
    /// Where buoyancy acts, m.
    #[serde(skip_serializing_if = "is_default")]
    pub center_of_buoyancy: Option<[f64; 3]>,
    /// Its own added mass at unit density about the link's origin, 6 × 6.
    #[serde(skip_serializing_if = "is_default")]
    pub added_mass: Option<Vec<Vec<f64>>>,
    /// Drag on the surface of that body, instead of the robot's.
    #[serde(skip_serializing_if = "is_default")]
    pub drag: Option<Drag>,
    /// Whether it may lie in what carries it, also where it doesn't at the start: the two don't feel each other through the water.
    #[serde(skip_serializing_if = "is_default")]
    pub overlaps_parent: bool,
}

impl RobotLink {
    /// What is chosen of the body that the link's frame and name are of, by the keys' names.
    pub(super) fn of_body(&self) -> Vec<&'static str> {
        let keys = [
            ("density", self.density.is_some()),
            ("center_of_mass", self.center_of_mass.is_some()),
            ("inertia", self.inertia.is_some()),
            ("volume", self.volume.is_some()),
            ("center_of_buoyancy", self.center_of_buoyancy.is_some()),
            ("added_mass", self.added_mass.is_some()),
            ("drag", self.drag.is_some()),
            ("overlaps_parent", self.overlaps_parent),
        ];
        let given = keys.into_iter().filter(|(_, given)| *given);
        given.map(|(key, _)| key).collect()
    }

    /// Puts what is chosen in place of what the file says.
    pub(super) fn apply(&self, body: &mut Body) {
        body.center_of_mass = self.center_of_mass.or(body.center_of_mass);
        body.volume = self.volume.or(body.volume);
        body.drag = self.drag.or(body.drag);
        body.overlaps_parent |= self.overlaps_parent;
        body.center_of_buoyancy = self.center_of_buoyancy.or(body.center_of_buoyancy);
        if self.inertia.is_some() {
            body.inertia.clone_from(&self.inertia);
        }
        if self.added_mass.is_some() {
            body.added_mass.clone_from(&self.added_mass);
        }
    }
}
