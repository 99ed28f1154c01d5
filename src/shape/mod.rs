//! Surfaces: closed triangle meshes, their mass properties, their check, formulas and files.
//!
//! A [`TriMesh`] bounds a volume: every edge has two faces, corners run counter-clockwise seen
//! from the water, so that normals point into the water. Lengths are in metres, in the frame of
//! the shape. [`TriMesh::new`] refuses anything else; [`check()`] says what is wrong, where, and what
//! to do about it.

pub mod check;
#[cfg(feature = "meshio")]
pub mod file;
pub mod gap;
mod mass;
mod mesh;
pub mod primitive;
mod refine;
mod remesh;
mod topology;
mod weld;

pub use check::{Finding, Kind, MeshReport, Severity, check, check_parts};
pub use gap::{Distance, Gap, Gaps, Other};
pub use mass::MassProperties;
pub use mesh::{Edge, TriMesh};
pub use primitive::{DEFAULT_FACES, MAX_FACES, build, parse_shape, shape_name, validate};
pub use refine::{MAX_ADDED_FACES, refine, validate_refinements};
