//! Shapes by formula as convex bodies.

use super::description::Shape;
use super::text::shape_name;
use super::validate::validate;
use crate::error::Result;
use crate::geometry::Solid;
use crate::geometry::convex::{Core, Cylinder, Ellipsoid, Form};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// The convex body of a shape by formula with the pose `offset` in its body (shape to body), exact whatever number of
/// faces the shape asks for; none for a mesh.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) naming the field if a parameter can't be.
pub fn solid(shape: &Shape, offset: Pose) -> Result<Option<Solid>> {
    let name = shape_name(shape);
    validate(shape, &name)?;
    let form = match shape {
        Shape::Sphere { radius, .. } => Form::Core(Core::ball(*radius)),
        Shape::Capsule { radius, length, .. } => Form::Core(Core::capsule(*radius, *length)),
        Shape::Ellipsoid { semi_axes, .. } => Form::Ellipsoid(Ellipsoid {
            semi_axes: Vec3::from(*semi_axes),
        }),
        Shape::Cylinder { radius, length, .. } => Form::Cylinder(Cylinder {
            radius: *radius,
            half: 0.5 * length,
        }),
        Shape::Box { size, .. } => {
            let [x, y, z] = size.map(|l| 0.5 * l);
            let profile = [[-y, -z], [y, -z], [y, z], [-y, z]];
            Form::Core(extrude(&name, &profile, x)?)
        }
        Shape::Prism {
            profile, length, ..
        } => Form::Core(extrude(&name, &corners_of(profile), 0.5 * length)?),
        Shape::Mesh { .. } | Shape::Triangles { .. } => return Ok(None),
    };
    Ok(Some(Solid { form, offset }))
}

/// A prism over a counter-clockwise profile in the y-z plane, from −`half` to `half` along x.
fn extrude(name: &str, profile: &[[f64; 2]], half: f64) -> Result<Core> {
    let n = profile.len();
    let end = |x: f64| profile.iter().map(move |&[y, z]| Vec3::new(x, y, z));
    let corners = end(-half).chain(end(half)).collect();
    let mut loops = vec![(0..n).rev().collect(), (n..2 * n).collect()];
    loops.extend((0..n).map(|k| {
        let next = (k + 1) % n;
        vec![k, next, n + next, n + k]
    }));
    Core::polyhedron(name, corners, &loops)
}

/// The corners of a convex profile, counter-clockwise.
fn corners_of(profile: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let [[ax, ay], [bx, by], [cx, cy]] = [profile[0], profile[1], profile[2]];
    let mut corners = profile.to_vec();
    if (bx - ax) * (cy - by) < (by - ay) * (cx - bx) {
        corners.reverse();
    }
    corners
}
