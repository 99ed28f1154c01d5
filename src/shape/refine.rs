//! Shapes refined in regions.

use super::description::Shape;
use crate::error::Result;
use crate::geometry::{self, ExactSurface, Refinement, TriMesh};
use hydrograd_adjoint::lie::Vec3;

impl From<&Shape> for ExactSurface {
    /// The surface that a mesh of the shape stands for.
    fn from(shape: &Shape) -> Self {
        match *shape {
            Shape::Sphere { radius, .. } => Self::Ellipsoid(Vec3::repeat(radius)),
            Shape::Ellipsoid { semi_axes, .. } => Self::Ellipsoid(semi_axes.into()),
            Shape::Cylinder { radius, length, .. } => Self::Cylinder {
                radius,
                half: 0.5 * length,
            },
            Shape::Capsule { radius, length, .. } => Self::Capsule {
                radius,
                half: 0.5 * length,
            },
            Shape::Box { .. }
            | Shape::Prism { .. }
            | Shape::Mesh { .. }
            | Shape::Triangles { .. } => Self::Flat,
        }
    }
}

/// As [`geometry::refine()`], for a mesh of a shape: new vertices lie on the shape's own surface where that is
/// curved.
///
/// # Errors
/// As there.
pub fn refine(
    mesh: &TriMesh,
    shape: &Shape,
    regions: &[Refinement],
    place: &str,
) -> Result<TriMesh> {
    geometry::refine(mesh, &shape.into(), regions, place)
}
