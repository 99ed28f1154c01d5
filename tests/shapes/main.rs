//! Bodies' surfaces: primitives, prisms, files and refinement.

#[cfg(feature = "meshio")]
mod files;
mod primitives;
mod prisms;
mod refine;

#[path = "../support/mod.rs"]
mod support;
