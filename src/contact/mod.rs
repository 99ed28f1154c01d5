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
//! is continuous and rotates the faster the nearer a corner or edge of one body is to one of the other.
//! Inside a polyhedron the distance is that to the nearest face, and the normal jumps where the
//! nearest face changes, by the angle between the two. The point where two edges cross fades out,
//! with continuous slope, as it nears the end of an edge (the corner takes over) and as the edges
//! become parallel. Two corners at one place, or two edges end on end, are seen from either body and
//! count twice.

mod core;
mod core_core;
mod ellipsoid;
mod ellipsoid_core;
mod ellipsoid_pair;
mod facets;
mod pairs;
mod point;
mod shape;

pub use core_core::PARALLEL;
pub use pairs::{ContactPair, Contacts, against_wall, between};
pub use point::{ContactPoint, Rows3, Slopes};
pub use shape::{CYLINDER_SIDES, ContactShape};
