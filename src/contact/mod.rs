//! Where convex bodies and walls are near one another: signed gaps with their first derivatives.
//!
//! A concave body is several convex pieces, each of which is looked at by itself. A convex body or piece is one of three things ([`crate::geometry::Solid`]): an *ellipsoid*, a *cylinder*, or a *core*, the convex hull of its
//! corners, with a radius about it: a ball is a corner, a capsule an edge, a box a polyhedron of radius zero.
//!
//! - An ellipsoid and anything else: one point, that of their common normal, which
//!   follows the faces, edges and corners of the other without a jump, overlapping too, but where two ways apart are equally short.
//! - Core and core: every corner of either against the signed distance of the other, and every
//!   edge against every edge where the two cross. Faces that lie on one another thus get several
//!   points. A ball has nothing but its centre and so gets one.
//! - Cylinder and core, or cylinder: the nearest point of either rim, eight points of each rim that stay in place, the
//!   corners of the core, where edges and rims come over a rim, and where edges and axes cross side to side.
//! - Ellipsoid and wall: the lowest point. Core and wall: all corners. Cylinder and wall: the lowest point of either rim,
//!   and the eight that stay in place.
//!
//! Of bodies apart, the least gap of all points with a weight is exact, except where two edges (or an edge and the side of a
//! cylinder) cross near the end of one or
//! are parallel to within three times [`PARALLEL`]: the crossing has faded there, and the points that
//! are left may be farther, by at most 0.03 of the shorter edge.
//!
//! # How smooth
//! A corner over a face through which its own body leads on is beside what that stands on, and fades out. Outside a body its distance has a continuous gradient, and so have gap and position; the normal
//! is continuous and rotates the faster the nearer a corner or edge of one body is to one of the other.
//! Inside a polyhedron the distance of a corner is that to the nearest face through which its body may leave (of flush bodies not the sides), and the normal jumps where the
//! nearest face changes, by the angle between the two; so it does inside a cylinder. The point where two edges cross fades out,
//! with continuous slope, as it nears the end of an edge (the corner takes over) and as the edges
//! become parallel. Two corners at one place, or two edges end on end, are seen from either body and
//! count twice.
//!
//! The nearest point of a rim jumps to the other side as the normal tips past the cylinder's axis. Below a sine of [`TILT`]
//! between the two it fades out, with the square of that at last, and the [`RIM_POINTS`] in place fade in. An edge that has sunk
//! into a rim and is parallel to it has no point; the axis of a capsule or a cylinder that passes over a rim along its tangent
//! has one of its own.

mod arc;
mod core_core;
mod cylinder;
mod cylinder_pair;
mod facets;
mod over_rim;
mod pairs;
mod plane;
mod point;
mod rim;
mod round_core;
mod round_pair;
mod shape;
mod sunk;
mod weight;

pub use core_core::PARALLEL;
pub use pairs::{ContactPair, Contacts, against_wall, between};
pub use point::{ContactPoint, Rows3, Slopes};
pub use rim::{RIM_POINTS, TILT};
pub use shape::ContactShape;
