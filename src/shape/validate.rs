//! Parameters of shapes that can't be.

use super::description::{DEFAULT_FACES, MAX_FACES, Shape};
use super::primitive::prism;
use crate::error::{Error, Result};
use crate::geometry::check_scale;

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
    match shape {
        Shape::Sphere { radius, .. } => length("radius", *radius)?,
        Shape::Ellipsoid { semi_axes, .. } => lengths("semi_axes", semi_axes)?,
        Shape::Box { size, .. } => lengths("size", size)?,
        Shape::Cylinder {
            radius, length: l, ..
        } => {
            length("radius", *radius)?;
            length("length", *l)?;
        }
        Shape::Capsule {
            radius, length: l, ..
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
        }
        Shape::Prism {
            profile, length: l, ..
        } => {
            prism::check_profile(profile, place)?;
            length("length", *l)?;
        }
        Shape::Mesh { scale, .. } => check_scale(place, *scale)?,
        // What else is wrong with it, its mesh tells.
        Shape::Triangles { vertices, .. } => {
            let finite = |v: &[f64; 3]| v.iter().all(|x| x.is_finite());
            if let Some(v) = vertices.iter().position(|v| !finite(v)) {
                return Err(Error::input(
                    format!("{place}: vertices[{v}]"),
                    format!("{:?}", vertices[v]),
                    "give finite coordinates in metres",
                ));
            }
        }
    }
    let asked = shape.asked_faces();
    asked.map_or(Ok(()), |faces| check_faces(place, faces))
}

pub(super) fn check_faces(place: &str, faces: usize) -> Result<()> {
    if (1..=MAX_FACES).contains(&faces) {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: faces"),
        faces,
        format!("ask for 1 to {MAX_FACES} faces (default {DEFAULT_FACES})"),
    ))
}
