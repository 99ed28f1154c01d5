//! Where surfaces touch: signed distances between convex bodies and walls, with their derivatives.

pub mod geometry;
mod pairs;

pub use geometry::{ContactPoint, Geometry, Slopes};
pub use pairs::{ContactPair, Contacts};
