//! Bodies' surfaces: primitives, prisms, files, refinement, and the gaps between them.

#[cfg(feature = "urdf")]
mod collada;
mod crossing;
mod exact;
#[cfg(feature = "meshio")]
mod files;
mod gaps;
mod hulls;
mod primitives;
mod prisms;
mod refine;
#[cfg(feature = "meshio")]
mod vertices;

#[path = "../support/mod.rs"]
mod support;
