//! Shapes: what a user writes of a body's surface, and the closed triangle mesh that it becomes.
//!
//! A [`Shape`] is given by formula or as a mesh, number by number or in a file. [`build()`] makes its
//! [`TriMesh`], [`solid()`] the convex body that a formula describes. Lengths are in metres, in the frame of the shape.

mod build;
mod description;
mod divide;
#[cfg(feature = "meshio")]
pub mod file;
mod mass;
mod parameters;
mod primitive;
mod refine;
mod solid;
mod text;
mod validate;

pub use crate::geometry::{
    Distance, Edge, Finding, Gap, Gaps, Kind, MAX_ADDED_FACES, MassProperties, MeshReport, Other,
    Severity, Solid, TriMesh, check_parts, validate_refinements,
};
pub use build::build;
pub use description::{DEFAULT_FACES, MAX_FACES, Shape};
pub(crate) use divide::{Edges, divide};
pub use refine::refine;
pub use solid::solid;
pub use text::{parse_shape, shape_name};
pub use validate::validate;
