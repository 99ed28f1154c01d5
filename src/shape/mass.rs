//! Volume, area, centroid and inertia of the volume inside a closed mesh, in closed form, and of shapes by
//! formula.
//!
//! The volume is the sum of signed tetrahedra from a reference point to the faces, so any closed
//! mesh is right, convex or not. For a tetrahedron with one corner at the reference and the others
//! at a, b, c, with det = a · (b × c) and s = a + b + c,
//!
//! ∫ dV = det/6,  ∫ x dV = det/24 s,  ∫ x xᵀ dV = det/120 (a aᵀ + b bᵀ + c cᵀ + s sᵀ).
//!
//! # References
//! F. Tonon, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of its
//! vertex coordinates", J. Math. Stat. 1 (2005) 8–11.

use super::mesh::{TriMesh, area_vector, bounds};
use super::primitive::{build, shape_name, validate};
use crate::error::Result;
use crate::scene::Shape;
use crate::special::r_d;
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};
use std::f64::consts::PI;
use std::path::Path;

/// What a body filled evenly at unit density has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Volume, m³.
    pub volume: f64,
    /// Area of the surface, m².
    pub area: f64,
    /// Centroid of the volume, m, frame of the shape.
    pub centroid: Vec3,
    /// Inertia about the centroid per unit density, axes of the shape, m⁵: kg m² after
    /// multiplication with kg/m³.
    pub inertia: Mat3,
}

impl MassProperties {
    /// Of the volume inside `mesh`. Without an inside (an open or flat mesh) the numbers mean
    /// nothing, and centroid and inertia can be NaN.
    pub fn of(mesh: &TriMesh) -> Self {
        // About the middle of the bounding box: far from the origin, differences of large
        // numbers would eat the digits.
        let [low, high] = mesh.bounds();
        let reference = low + (high - low) * 0.5;
        let mut area = 0.0;
        let mut volume = 0.0;
        let mut first = Vec3::zeros();
        let mut second = Mat3::zeros();
        for f in 0..mesh.faces().len() {
            let corners = mesh.corners(f).map(|x| x - reference);
            area += area_vector(&corners).norm();
            let [a, b, c] = corners;
            let det = a.dot(&b.cross(&c));
            let s = a + b + c;
            volume += det;
            first += det * s;
            second += det
                * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
        }
        volume /= 6.0;
        let offset = first / (24.0 * volume);
        let moments = second / 120.0 - volume * offset * offset.transpose();
        Self {
            volume,
            area,
            centroid: reference + offset,
            inertia: Mat3::identity() * moments.trace() - moments,
        }
    }
}

impl MassProperties {
    /// The same of the body placed at `pose`.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            centroid: pose.apply(&self.centroid),
            inertia: pose.rotation * self.inertia * pose.rotation.transpose(),
            ..*self
        }
    }

    /// Of a shape by formula, m, in the shape's frame: what finer and finer meshes of it tend to. None
    /// for a mesh.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) naming the field if a parameter can't be.
    ///
    /// # References
    /// Area of an ellipsoid: NIST DLMF 19.33.1, 4π R_G(a²b², a²c², b²c²).
    pub fn by_formula(shape: &Shape) -> Result<Option<Self>> {
        validate(shape, &shape_name(shape))?;
        let (volume, area, second) = match *shape {
            Shape::Sphere { radius, .. } => ellipsoid([radius; 3]),
            Shape::Ellipsoid { semi_axes, .. } => ellipsoid(semi_axes),
            Shape::Box {
                size: [a, b, c], ..
            } => {
                let volume = a * b * c;
                let second = [a, b, c].map(|l| volume * l * l / 12.0);
                (volume, 2.0 * (a * b + b * c + c * a), second)
            }
            Shape::Cylinder {
                radius: r,
                length: l,
                ..
            } => {
                let volume = PI * r * r * l;
                let (across, along) = (volume * r * r / 4.0, volume * l * l / 12.0);
                (volume, 2.0 * PI * r * (r + l), [across, across, along])
            }
            Shape::Capsule {
                radius: r,
                length: l,
                ..
            } => {
                let (side, ends) = (PI * r * r * l, 4.0 / 3.0 * PI * r * r * r);
                let across = (side / 4.0 + ends / 5.0) * r * r;
                // ∫ z² of two hemispheres at ±l/2, whose centroids are at 3/8 r from their flats.
                let along =
                    side * l * l / 12.0 + ends * (r * r / 5.0 + 0.375 * r * l + 0.25 * l * l);
                let area = 2.0 * PI * r * (2.0 * r + l);
                (side + ends, area, [across, across, along])
            }
            // Flat faces: any mesh of it is exact.
            Shape::Prism { .. } => return Ok(Some(Self::of(&build(shape, Path::new(""), None)?))),
            Shape::Mesh { .. } | Shape::Triangles { .. } => return Ok(None),
        };
        let moments = Mat3::from_diagonal(&Vec3::from(second));
        Ok(Some(Self {
            volume,
            area,
            centroid: Vec3::zeros(),
            inertia: Mat3::identity() * moments.trace() - moments,
        }))
    }
}

/// Volume, area and ∫ x², ∫ y², ∫ z².
fn ellipsoid(semi_axes: [f64; 3]) -> (f64, f64, [f64; 3]) {
    let [a, b, c] = semi_axes;
    let volume = 4.0 / 3.0 * PI * a * b * c;
    // R_G of the products' squares, over the longest semi-axis lest powers overflow.
    let scale = a.max(b).max(c);
    let [a, b, c] = semi_axes.map(|l| l / scale);
    let [x, y, z] = [b * c, c * a, a * b].map(|p| p * p);
    let mean = x * (y + z) * r_d(y, z, x) + y * (z + x) * r_d(z, x, y) + z * (x + y) * r_d(x, y, z);
    let area = 4.0 * PI * scale * scale * mean / 6.0;
    (volume, area, semi_axes.map(|l| volume * l * l / 5.0))
}

/// Signed volume inside some faces, m³, about the middle of their own bounding box.
pub(super) fn signed_volume(corners: &[[Vec3; 3]]) -> f64 {
    let [low, high] = bounds(corners.iter().flatten());
    let reference = low + (high - low) * 0.5;
    corners
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|x| x - reference);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}
