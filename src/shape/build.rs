//! Shapes into meshes.

use super::description::{DEFAULT_FACES, Shape};
use super::primitive::{cuboid, prism, revolved, sphere};
use super::text::shape_name;
use super::validate::{check_faces, validate};
use crate::error::Result;
use crate::geometry::TriMesh;
use hydrograd_adjoint::lie::Vec3;
use std::path::Path;

/// The mesh of a shape, m, in the shape's frame. The number of faces is `faces_override`, else
/// the shape's own, else [`DEFAULT_FACES`]; the nearest that the pattern allows is taken. A mesh
/// from a file (relative to `base_dir`) keeps its faces whatever is asked.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) naming the field if a parameter can't be, [`Error::Mesh`](crate::Error::Mesh) if the shape is so
/// thin that its faces have no area, and what reading a file can give.
pub fn build(shape: &Shape, base_dir: &Path, faces_override: Option<usize>) -> Result<TriMesh> {
    let name = shape_name(shape);
    validate(shape, &name)?;
    let target = faces_override.or(shape.asked_faces());
    let target = target.unwrap_or(DEFAULT_FACES);
    if let Some(faces) = faces_override {
        check_faces(&name, faces)?;
    }
    let (vertices, faces) = match shape {
        Shape::Sphere { radius, .. } => sphere::ellipsoid([*radius; 3], target),
        Shape::Ellipsoid { semi_axes, .. } => sphere::ellipsoid(*semi_axes, target),
        Shape::Box { size, .. } => cuboid::cuboid(*size, target),
        Shape::Cylinder { radius, length, .. } => revolved::cylinder(*radius, *length, target),
        Shape::Capsule { radius, length, .. } => revolved::capsule(*radius, *length, target),
        Shape::Prism {
            profile, length, ..
        } => prism::prism(profile, *length, target),
        Shape::Mesh { path, scale } => return read(&base_dir.join(path), *scale),
        Shape::Triangles { vertices, faces } => (
            vertices.iter().map(|v| Vec3::from(*v)).collect(),
            faces.clone(),
        ),
    };
    TriMesh::new(name, vertices, faces)
}

#[cfg(feature = "meshio")]
fn read(path: &Path, scale: f64) -> Result<TriMesh> {
    super::file::read(path, scale)
}

#[cfg(not(feature = "meshio"))]
fn read(path: &Path, _scale: f64) -> Result<TriMesh> {
    Err(crate::Error::Unsupported {
        what: format!("reading {}", path.display()),
        why: "this build leaves out mesh files".into(),
        instead: "build with the feature `meshio`, or use a shape by formula".into(),
    })
}
