//! Closed triangle meshes and plane walls, and what is asked of them; all else that knows surfaces stands
//! on this folder.
//!
//! A [`TriMesh`] bounds a volume: every edge has two faces, corners run counter-clockwise seen from
//! the water, so that normals point into the water. [`TriMesh::new`] refuses anything else, so that
//! whoever has one needs no check of his own; [`check_parts`] says what is wrong, where, and what to do about
//! it. Lengths are in metres, in the frame of the shape or body.
//!
//! - [`MassProperties`], [`Faces`], [`Ball`]: volume, inertia, face geometry, bounding balls.
//! - `sharp`, `remesh`, [`refine()`]: sharp edges, meshes with more or fewer faces, everywhere or in regions.
//! - `convex`: ellipsoids, cylinders and convex hulls with a radius: outermost points, distances; [`Solid`] is one, placed
//!   in its body.
//! - [`Gaps`]: signed distances between placed solids and meshes, walls and points; `interior`: rays, inner
//!   tangent balls and winding numbers of one mesh.
//! - [`Wall`], [`HalfSpace`], [`Image`]: plane walls and the mirror images that they make.

mod beneath;
mod boxes;
mod broad;
mod casing;
#[cfg(feature = "urdf")]
mod cavities;
mod check;
mod cluster;
pub(crate) mod convex;
mod exact;
mod faces;
mod gap;
mod image;
mod interior;
mod mass;
mod mesh;
mod opposite;
mod pairing;
#[cfg(test)]
mod parry;
mod points;
mod refine;
mod remesh;
mod sharp;
#[cfg(test)]
mod tests;
pub(crate) mod topology;
mod tree;
mod triangle;
mod wall;
pub(crate) mod weld;

pub(crate) use beneath::Beneath;
pub(crate) use broad::{Neighbours, Region};
pub(crate) use casing::Casing;
#[cfg(feature = "urdf")]
pub(crate) use cavities::with_cavities;
#[cfg(feature = "meshio")]
pub(crate) use check::has_area;
pub use check::{Finding, Kind, MeshReport, Severity, check_parts};
pub(crate) use cluster::{Cluster, clusters};
pub(crate) use convex::Field;
pub use convex::Solid;
pub use faces::Faces;
pub(crate) use faces::equilateral_edge;
pub use gap::{Distance, Gap, Gaps, Other, Share, overlap_error};
pub use image::Image;
pub(crate) use interior::Interior;
pub use mass::MassProperties;
pub(crate) use mass::impossible_inertia;
pub(crate) use mesh::check_scale;
pub use mesh::{Edge, TriMesh};
pub(crate) use opposite::Opposite;
pub use pairing::Pairing;
pub use points::Ball;
pub(crate) use points::bounds;
pub use refine::{ExactSurface, MAX_ADDED_FACES, Refinement, refine, validate_refinements};
pub(crate) use refine::{divided, halved};
pub use wall::{HalfSpace, Wall, WallSurface};
