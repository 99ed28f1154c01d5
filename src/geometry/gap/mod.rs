//! Smallest gaps between placed surfaces, and between surfaces and walls.
//!
//! A [`Gaps`] is built once per scene and asked at every step. Distances between surfaces that
//! don't overlap are those of the triangle meshes themselves, to rounding. Overlap is found
//! where surfaces cross and where one lies inside the other; its depth is a lower bound of the
//! shift that separates the two, measured at vertices, face centres, points well inside and along
//! crossing edges.

mod gaps;
mod overlap;
mod pair;
mod share;

pub use gaps::{Distance, Gap, Gaps, Other};
pub use overlap::overlap_error;
pub use share::Share;
