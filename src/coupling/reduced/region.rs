//! Where a body resolves smaller gaps than elsewhere.

use crate::adjoint::lie::Vec3;
use serde::{Deserialize, Serialize};

/// A ball within which a body resolves a smaller gap to others than elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Its centre, m, in the body's frame.
    pub center: Vec3,
    /// Its radius, m.
    pub radius: f64,
    /// Smallest gap to other bodies (and half of that to walls) that is resolved, m.
    pub gap: f64,
}

impl Region {
    /// Whether a point (m, body's frame) lies in it.
    pub fn contains(&self, point: &Vec3) -> bool {
        (point - self.center).norm_squared() <= self.radius * self.radius
    }

    /// The same of a body that is larger by `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            center: self.center * factor,
            radius: self.radius * factor,
            gap: self.gap * factor,
        }
    }
}
