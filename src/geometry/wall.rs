//! Plane walls.

use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Vec3, unit};
use serde::{Deserialize, Serialize};

/// A plane that bounds the water.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// A point of the plane, m.
    pub point: [f64; 3],
    /// Normal into the fluid; need not be of unit length.
    pub normal: [f64; 3],
    /// What the plane is.
    #[serde(default, skip_serializing_if = "WallSurface::is_rigid")]
    pub surface: WallSurface,
}

/// What a plane does to the flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallSurface {
    /// No flow through it: images of the same sign.
    #[default]
    Rigid,
    /// Potential zero: a flat free surface in the limit of fast motion, without waves; images of the
    /// opposite sign. With the fidelities `reduced` and `auto`, and with `full` by the method `panel`.
    Free,
}

impl WallSurface {
    fn is_rigid(&self) -> bool {
        *self == Self::Rigid
    }
}

impl Wall {
    /// A rigid wall through `point` (m) with the normal into the fluid.
    pub const fn rigid(point: [f64; 3], normal: [f64; 3]) -> Self {
        Self {
            point,
            normal,
            surface: WallSurface::Rigid,
        }
    }

    /// The fluid's side of it. `number` is that of the wall, for messages.
    ///
    /// # Errors
    /// [`Error::Input`] naming the wall unless point and normal are finite and the normal isn't zero.
    pub fn half_space(&self, number: usize) -> Result<HalfSpace> {
        HalfSpace::new(&self.point.into(), &self.normal.into()).ok_or_else(|| {
            Error::input(
                format!("walls[{number}]"),
                format!("point {:?}, normal {:?}", self.point, self.normal),
                "give a finite point and a finite normal that isn't zero, pointing into the fluid",
            )
        })
    }

    /// The fluid's sides of several.
    ///
    /// # Errors
    /// As [`Wall::half_space`].
    pub fn half_spaces(walls: &[Self]) -> Result<Vec<HalfSpace>> {
        let numbered = walls.iter().enumerate();
        numbered.map(|(i, w)| w.half_space(i)).collect()
    }
}

/// All points on one side of a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// A point of the plane, m.
    pub point: Vec3,
    /// Unit normal, into the half space.
    pub normal: Vec3,
}

impl HalfSpace {
    /// From a point of the plane (m) and a normal of any length; none unless both are finite and the normal
    /// isn't zero.
    pub fn new(point: &Vec3, normal: &Vec3) -> Option<Self> {
        let finite = normal.iter().chain(point.iter()).all(|x| x.is_finite());
        (normal.amax() > 0.0 && finite).then(|| Self {
            point: *point,
            normal: unit(normal),
        })
    }

    /// How far `x` lies in the half space, m; negative outside.
    #[inline]
    pub fn height(&self, x: &Vec3) -> f64 {
        (x - self.point).dot(&self.normal)
    }
}
