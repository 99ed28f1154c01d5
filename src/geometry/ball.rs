//! Balls around bodies.

use super::points::bounds;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// A ball that holds a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre, m.
    pub center: Vec3,
    /// Its radius, m.
    pub radius: f64,
}

impl Ball {
    /// Around the middle of the bounding box of some points, as large as they need; of radius zero about the
    /// origin without points.
    pub fn around<'a>(points: impl Iterator<Item = &'a Vec3> + Clone) -> Self {
        let [low, high] = bounds(points.clone());
        let center = 0.5 * (low + high);
        let far = |r: f64, x: &Vec3| r.max((x - center).norm());
        Self {
            center,
            radius: points.fold(0.0, far),
        }
    }

    /// The ball around the body placed at `pose`.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            center: pose.apply(&self.center),
            radius: self.radius,
        }
    }

    /// Between two balls, m; negative where they overlap.
    pub fn distance(&self, other: &Self) -> f64 {
        (other.center - self.center).norm() - (self.radius + other.radius)
    }
}
