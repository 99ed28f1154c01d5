//! Bodies' surfaces: primitives, prisms, files, refinement, and the gaps between them.

mod crossing;
mod exact;
#[cfg(feature = "meshio")]
mod files;
mod gaps;
mod primitives;
mod prisms;
mod refine;

#[path = "../support/mod.rs"]
mod support;
