//! Currents that change with depth and time.

use super::super::Motion;
use super::{Force, Scene, dot, number};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A current beside the uniform steady one of [`Fluid`](crate::scene::Fluid): its velocity times a share by depth and a factor by time, on all bodies in the water. Several add up.
///
/// Drag, fins, edges and thrusters feel the water at the body: at its centroid. Of the inertia of the water a body feels its own added mass in that stream and the pressure that
/// accelerates the undisturbed water, but not how others change it there, nor the lift of shear.
///
/// ```
/// use hydrograd::scene::{Body, Current, Fluid, Motion, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.1)).named("float").density(998.0).at([0.0, 0.0, -5.0]));
/// // 0.4 m/s at the surface, nothing below 10 m; a tide of 12.4 hours.
/// let tide = Motion::Sine { offset: 0.0, amplitude: 1.0, frequency: 1.4075e-4, phase: 0.0 };
/// scene.add_force(Current::new([0.4, 0.0, 0.0]).profile(vec![[0.0, 1.0], [4.0, 0.7], [10.0, 0.0]]).over_time(tide).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Current {
    /// Name, unique in the scene; default: "current" and its number among the forces.
    pub name: Option<String>,
    /// Where share and factor are one, m/s, world frame; parallel to the walls, and level where it changes with depth.
    pub velocity: [f64; 3],
    /// Depth (m, ascending) and the share of the velocity there, two points at least; a smooth curve (C¹) between them that overshoots none, the end's share beyond. Empty: one at
    /// every depth. Depth is counted from the waterline, or from z = 0 against gravity, along z without any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<[f64; 2]>,
    /// Factor by time, dimensionless; default: one at all times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_time: Option<Motion>,
}

impl Current {
    /// Uniform and steady, m/s, world frame.
    pub fn new(velocity: [f64; 3]) -> Self {
        Self {
            velocity,
            ..Self::default()
        }
    }
}

setters! { Current {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// Depth (m, ascending) and the share of the velocity there.
    profile(points: Vec<[f64; 2]>) => profile = points;
    /// Factor by time.
    over_time(factor: Motion) => over_time = Some(factor);
} }

impl From<Current> for Force {
    fn from(current: Current) -> Self {
        Force::Current(current)
    }
}

/// Largest part of a current that changes with depth along the depth, over its size.
const LEVEL: f64 = 1e-9;

impl Current {
    /// Checks all; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        for x in self.velocity {
            number(place("velocity"), x, true, "give finite numbers, in m/s")?;
        }
        scene.check_through_walls(&place("velocity"), self.velocity)?;
        let points = self.profile.iter().flatten();
        for x in points {
            number(
                place("profile"),
                *x,
                true,
                "give finite numbers: depth in m, share",
            )?;
        }
        if self.profile.len() == 1 {
            return Err(Error::input(
                place("profile"),
                "1 point",
                "give two points at least, or none for a current that is the same at every depth",
            ));
        }
        for (i, pair) in self.profile.windows(2).enumerate() {
            if pair[1][0] <= pair[0][0] {
                return Err(Error::input(
                    place(&format!("profile[{}]", i + 1)),
                    pair[1][0],
                    format!("depths must ascend, and the one before is {} m", pair[0][0]),
                ));
            }
        }
        if !self.profile.is_empty() {
            let up = scene.up();
            let level = |velocity: [f64; 3]| {
                let size = velocity.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                dot(up, velocity).abs() <= LEVEL * size
            };
            let refuse = |place: String, velocity: [f64; 3], remedy: &str| {
                Err(Error::input(place, format!("{velocity:?}"), remedy))
            };
            if !level(self.velocity) {
                return refuse(
                    place("velocity"),
                    self.velocity,
                    "must be level, as water that changes with depth can't flow along it: take the part along gravity away, or the profile",
                );
            }
            let others = scene.currents().map(|(_, other)| other.velocity);
            if let Some(rising) = others.chain([scene.fluid.current]).find(|v| !level(*v)) {
                return refuse(
                    place("profile"),
                    rising,
                    "no other current may rise or sink through water that changes with depth: take its part along gravity away, or the profile",
                );
            }
        }
        match &self.over_time {
            Some(motion) => motion.check(&place("over_time")),
            None => Ok(()),
        }
    }
}
