//! Where convex bodies and walls are near one another: signed gaps with their first derivatives.
//!
//! A body is one of two things. An *ellipsoid*, or a *core*, the convex hull of its corners, with a
//! radius about it: a ball is a corner, a capsule an edge, a box a polyhedron of radius zero.
//!
//! - Ellipsoid and ellipsoid, ellipsoid and core: one point, that of their common normal, which
//!   follows the faces, edges and corners of the core without a jump.
//! - Core and core: every corner of either against the signed distance of the other, and every
//!   edge against every edge where the two cross. Faces that lie on one another thus get several
//!   points. A ball has nothing but its centre and so gets one.
//! - Ellipsoid and wall: the lowest point. Core and wall: all corners.
//!
//! Of bodies apart, the least gap is exact, except where two edges cross near the end of one or
//! are parallel to within three times [`PARALLEL`]: the crossing has faded there, and the corners that
//! are left may be farther, by at most 0.03 of the shorter edge.
//!
//! # How smooth
//! Outside a body its distance has a continuous gradient, and so have gap and position; the normal
//! is continuous and turns the faster the nearer a corner or edge of one body is to one of the other.
//! Inside a polyhedron the distance is that to the nearest face, and the normal jumps where the
//! nearest face changes, by the angle between the two. The point where two edges cross fades out,
//! with continuous slope, as it nears the end of an edge (the corner takes over) and as the edges
//! become parallel. Two corners that meet, or two edges end on end, are seen from either body and
//! count twice.

mod core;
mod cross;
mod ellipsoid;
mod facets;
mod field;
mod form;
mod pair;
mod point;
mod touch;

pub use cross::PARALLEL;
pub use form::{CYLINDER_SIDES, Geometry};
pub use point::{ContactPoint, Rows3, Slopes};

use crate::error::{Error, Result};
use crate::geometry::HalfSpace;
use form::Form;
use hydrograd_adjoint::lie::Pose;

/// The places where two bodies are nearer than `reach` (m); poses are body to world. The order is
/// always the same: corners of the first body, corners of the second, edges.
///
/// # Errors
/// [`Error::Input`] if a pose or `reach` isn't finite; [`Error::Solver`] if the common normal of
/// two ellipsoids isn't found, which needs one that lies deep in the other.
pub fn between(
    first: &Geometry,
    second: &Geometry,
    first_at: &Pose,
    second_at: &Pose,
    reach: f64,
) -> Result<Vec<ContactPoint>> {
    check(reach, &[first_at, second_at])?;
    if first.ball_at(first_at).distance(&second.ball_at(second_at)) >= reach {
        return Ok(Vec::new());
    }
    let (a_at, b_at) = (
        first_at.compose(&first.offset),
        second_at.compose(&second.offset),
    );
    let found = match (&first.form, &second.form) {
        (Form::Core(a), Form::Core(b)) => return Ok(cross::contacts(a, &a_at, b, &b_at, reach)),
        (Form::Ellipsoid(a), Form::Core(b)) => touch::contact(a, &a_at, b, &b_at, reach),
        (Form::Core(a), Form::Ellipsoid(b)) => {
            touch::contact(b, &b_at, a, &a_at, reach).map(|p| p.swapped())
        }
        (Form::Ellipsoid(a), Form::Ellipsoid(b)) => {
            Some(pair::contact(a, &a_at, b, &b_at)?).filter(|p| p.gap < reach)
        }
    };
    Ok(found.into_iter().collect())
}

/// The places where a body is nearer than `reach` (m) to a wall, world frame; the wall counts as the second
/// body. In the order of the corners.
///
/// # Errors
/// [`Error::Input`] if the pose or `reach` isn't finite.
pub fn against_wall(
    geometry: &Geometry,
    wall: &HalfSpace,
    at: &Pose,
    reach: f64,
) -> Result<Vec<ContactPoint>> {
    check(reach, &[at])?;
    let ball = geometry.ball_at(at);
    if wall.height(&ball.center) - ball.radius >= reach {
        return Ok(Vec::new());
    }
    let at = at.compose(&geometry.offset);
    let mut found = match &geometry.form {
        Form::Ellipsoid(ellipsoid) => vec![ellipsoid.against_plane(&at, wall)],
        Form::Core(core) => core.against_plane(&at, wall),
    };
    found.retain(|p| p.gap < reach);
    Ok(found)
}

fn check(reach: f64, poses: &[&Pose]) -> Result<()> {
    if !reach.is_finite() {
        return Err(Error::input(
            "contact: reach",
            reach,
            "give a finite length in metres",
        ));
    }
    let finite = |g: &&Pose| {
        g.rotation
            .iter()
            .chain(g.translation.iter())
            .all(|x| x.is_finite())
    };
    match poses.iter().find(|g| !finite(g)) {
        None => Ok(()),
        Some(pose) => Err(Error::input(
            "contact: pose",
            format!("position {:?}", pose.translation.as_slice()),
            "give finite poses; a smaller time step may keep them so",
        )),
    }
}
