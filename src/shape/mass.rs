//! Mass properties of shapes by formula.

use super::build::build;
use super::description::Shape;
use super::text::shape_name;
use super::validate::validate;
use crate::error::Result;
use crate::geometry::MassProperties;
use crate::special::r_d;
use hydrograd_adjoint::lie::{Mat3, Vec3};
use std::f64::consts::PI;
use std::path::Path;

impl MassProperties {
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
