//! Where sensors are.

use super::super::Sample;
use super::super::which::Which;
use crate::adjoint::lie::Vec3;

/// A place in the water where its velocity, or the flow's pressure, is read: a current meter, a lateral line, a pressure tap beside a fin.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The body that it is fixed to; none of one fixed in the world.
    pub body: Option<Which>,
    /// Its place, m: in the body's frame, or in the world's.
    pub at: [f64; 3],
}

impl Sensor {
    /// Fixed in the world, at a place in its frame, m.
    pub fn fixed(at: [f64; 3]) -> Self {
        Self { body: None, at }
    }

    /// Fixed to a body, at a place in its frame, m.
    pub fn on(body: impl Into<Which>, at: [f64; 3]) -> Self {
        Self {
            body: Some(body.into()),
            at,
        }
    }
}

/// A sensor in the scene: its body by number.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub body: Option<usize>,
    pub at: Vec3,
}

impl Placed {
    /// Where it is, world frame, m.
    pub fn point(&self, sample: &Sample) -> Vec3 {
        self.body
            .map_or(self.at, |b| sample.poses[b].apply(&self.at))
    }
}
