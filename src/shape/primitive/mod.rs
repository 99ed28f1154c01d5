//! Shapes by formula, as meshes: vertices on the exact surface, faces near-equilateral, and
//! mirror images of each other in x, y and z (prisms: in x), so that the mesh adds no coupling that
//! the shape doesn't have.

mod cuboid;
mod parse;
mod planar;
mod prism;
mod revolved;
mod sphere;

pub use parse::{parse_shape, shape_name};

use super::mesh::TriMesh;
use crate::error::{Error, Result};
use crate::scene::Shape;
use hydrograd_adjoint::lie::Vec3;
use std::path::Path;

/// Faces of a shape that doesn't ask for a number: four times refined icosahedron for spheres.
pub const DEFAULT_FACES: usize = 1280;
/// Most faces that a shape may ask for.
pub const MAX_FACES: usize = 4_000_000;

/// The mesh of a shape, m, in the shape's frame. The number of faces is `faces_override`, else
/// the shape's own, else [`DEFAULT_FACES`]; the nearest that the pattern allows is taken. A mesh
/// from a file (relative to `base_dir`) keeps its faces whatever is asked.
///
/// # Errors
/// [`Error::Input`] naming the field if a parameter can't be, [`Error::Mesh`] if the shape is so
/// thin that its faces have no area, and what reading a file can give.
pub fn build(shape: &Shape, base_dir: &Path, faces_override: Option<usize>) -> Result<TriMesh> {
    let name = shape_name(shape);
    validate(shape, &name)?;
    let target = |faces: &Option<usize>| faces_override.or(*faces).unwrap_or(DEFAULT_FACES);
    if let Some(faces) = faces_override {
        check_faces(&name, faces)?;
    }
    let (vertices, faces) = match shape {
        Shape::Sphere { radius, faces } => sphere::ellipsoid([*radius; 3], target(faces)),
        Shape::Ellipsoid { semi_axes, faces } => sphere::ellipsoid(*semi_axes, target(faces)),
        Shape::Box { size, faces } => cuboid::cuboid(*size, target(faces)),
        Shape::Cylinder {
            radius,
            length,
            faces,
        } => revolved::cylinder(*radius, *length, target(faces)),
        Shape::Capsule {
            radius,
            length,
            faces,
        } => revolved::capsule(*radius, *length, target(faces)),
        Shape::Prism {
            profile,
            length,
            faces,
        } => prism::prism(profile, *length, target(faces)),
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
    Err(Error::Unsupported {
        what: format!("reading {}", path.display()),
        why: "this build leaves out mesh files".into(),
        instead: "build with the feature `meshio`, or use a shape by formula".into(),
    })
}

/// Whether a shape's parameters can be: lengths finite and positive, faces in range. `place`
/// begins the message: the body's or the shape's name.
///
/// # Errors
/// [`Error::Input`] naming place and field, the value and what would be right.
pub fn validate(shape: &Shape, place: &str) -> Result<()> {
    let length = |field: &str, value: f64| -> Result<()> {
        // Outside this range areas, volumes and inertias leave double precision.
        if (1e-30..=1e30).contains(&value) {
            return Ok(());
        }
        Err(Error::input(
            format!("{place}: {field}"),
            value,
            "give a finite, positive length in metres",
        ))
    };
    let lengths = |field: &str, values: &[f64; 3]| -> Result<()> {
        (0..3).try_for_each(|i| length(&format!("{field}[{i}]"), values[i]))
    };
    let asked = match shape {
        Shape::Sphere { radius, faces } => {
            length("radius", *radius)?;
            faces
        }
        Shape::Ellipsoid { semi_axes, faces } => {
            lengths("semi_axes", semi_axes)?;
            faces
        }
        Shape::Box { size, faces } => {
            lengths("size", size)?;
            faces
        }
        Shape::Cylinder {
            radius,
            length: l,
            faces,
        } => {
            length("radius", *radius)?;
            length("length", *l)?;
            faces
        }
        Shape::Capsule {
            radius,
            length: l,
            faces,
        } => {
            length("radius", *radius)?;
            if *l == 0.0 {
                return Err(Error::input(
                    format!("{place}: length"),
                    l,
                    "a capsule without a cylindrical part is a sphere: use that",
                ));
            }
            length("length", *l)?;
            faces
        }
        Shape::Prism {
            profile,
            length: l,
            faces,
        } => {
            prism::check_profile(profile, place)?;
            length("length", *l)?;
            faces
        }
        Shape::Mesh { scale, .. } => {
            if !(scale.is_finite() && *scale > 0.0) {
                return Err(Error::input(
                    format!("{place}: scale"),
                    scale,
                    "give a finite, positive factor (0.001 for a file in millimetres)",
                ));
            }
            &None
        }
        // What is wrong with it, its mesh tells.
        Shape::Triangles { .. } => &None,
    };
    asked.map_or(Ok(()), |faces| check_faces(place, faces))
}

fn check_faces(place: &str, faces: usize) -> Result<()> {
    if (1..=MAX_FACES).contains(&faces) {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: faces"),
        faces,
        format!("ask for 1 to {MAX_FACES} faces (default {DEFAULT_FACES})"),
    ))
}

/// How far a number of faces and the stretch of the cells are from what was asked: the pattern
/// with the least is taken. The count weighs more; `stretch` are ratios, 1 for none.
fn misfit(faces: f64, target: f64, stretch: &[f64]) -> f64 {
    let count = (faces / target).ln() * 10.0;
    count * count + stretch.iter().map(|s| s.ln() * s.ln()).sum::<f64>()
}
