//! Contact between bodies, and between bodies and walls.

pub mod geometry;

pub use geometry::{ContactPoint, Geometry, Slopes};
