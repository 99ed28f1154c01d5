//! Plane walls as mirror images.
//!
//! In front of a rigid plane the flow is that of the bodies and their mirror images moving as mirrors
//! do: every source has an image of the same sign. At a free surface (zero potential, the limit of
//! high frequency) it has the opposite sign. Mutually perpendicular planes close under
//! reflection: two need three images, three need seven.

use super::wall::{Wall, WallSurface};
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3, Vec6, angular, linear, six};

/// A product of reflections, `x ↦ linear · x + shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Symmetric orthogonal matrix.
    pub linear: Mat3,
    /// Shift, m.
    pub shift: Vec3,
    /// Determinant of `linear`, ±1.
    pub parity: f64,
    /// Sign of the image sources: −1 for an odd number of reflections in free surfaces.
    pub sign: f64,
}

impl Image {
    /// No reflection.
    pub fn identity() -> Self {
        Self {
            linear: Mat3::identity(),
            shift: Vec3::zeros(),
            parity: 1.0,
            sign: 1.0,
        }
    }

    /// All images that `walls` make, the identity first.
    ///
    /// # Errors
    /// Walls that aren't mutually perpendicular.
    pub fn of_walls(walls: &[Wall]) -> Result<Vec<Self>> {
        let mut out = vec![Self::identity()];
        let mut normals: Vec<Vec3> = Vec::new();
        for (i, wall) in walls.iter().enumerate() {
            let plane = wall.half_space(i)?;
            let n = plane.normal;
            if let Some(k) = normals.iter().position(|m| m.dot(&n).abs() > 1e-9) {
                return Err(Error::input(
                    format!("walls[{i}].normal"),
                    format!("{:?}", wall.normal),
                    format!(
                        "must be perpendicular to that of walls[{k}]: images close only for \
                         mutually perpendicular walls; model others as fixed bodies"
                    ),
                ));
            }
            normals.push(n);
            let reflection = Mat3::identity() - 2.0 * n * n.transpose();
            let sign = match wall.surface {
                WallSurface::Rigid => 1.0,
                WallSurface::Free => -1.0,
            };
            let shift = 2.0 * n.dot(&plane.point) * n;
            let reflected: Vec<Image> = out
                .iter()
                .map(|image| Image {
                    linear: reflection * image.linear,
                    shift: reflection * image.shift + shift,
                    parity: -image.parity,
                    sign: sign * image.sign,
                })
                .collect();
            out.extend(reflected);
        }
        Ok(out)
    }

    /// As [`Image::of_walls`], for a fidelity, and its method, that know no free surface.
    ///
    /// # Errors
    /// As there, and a free surface.
    pub fn of_rigid_walls(walls: &[Wall], fidelity: &str) -> Result<Vec<Self>> {
        if let Some(w) = walls.iter().position(|w| w.surface == WallSurface::Free) {
            return Err(Error::Unsupported {
                what: format!("the free surface walls[{w}] with {fidelity}"),
                why: "its images have the opposite sign, which only the fidelity reduced and the method panel have"
                    .into(),
                instead: "use the fidelity reduced or auto, the method panel, or a rigid wall"
                    .into(),
            });
        }
        Self::of_walls(walls)
    }

    /// Whether this is no reflection.
    pub fn is_identity(&self) -> bool {
        self.linear == Mat3::identity()
    }

    /// Rotation-like part and shift of the image of a body at `pose`: body points to image points.
    pub fn placement(&self, pose: &Pose) -> (Mat3, Vec3) {
        (
            self.linear * pose.rotation,
            self.linear * pose.translation + self.shift,
        )
    }

    /// Spatial twist of the image of a body that moves with the spatial twist `z`.
    pub fn twist(&self, z: &Vec6) -> Vec6 {
        let rate = self.parity * (self.linear * angular(z));
        six(&(self.linear * linear(z) - rate.cross(&self.shift)), &rate)
    }

    /// Transpose of [`Image::twist`]: the wrench on the body from that on its image.
    pub fn twist_vjp(&self, wrench: &Vec6) -> Vec6 {
        let force = linear(wrench);
        six(
            &(self.linear.tr_mul(&force)),
            &(self.parity
                * self
                    .linear
                    .tr_mul(&(angular(wrench) - self.shift.cross(&force)))),
        )
    }
}
