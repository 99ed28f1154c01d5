//! hydrograd: a differentiable simulator of rigid bodies that feel each other through the water.

pub mod boundary;
pub mod error;
pub mod scene;
pub mod shape;

pub use error::{Error, Result};
pub use hydrograd_adjoint as adjoint;
pub use shape::{MassProperties, MeshReport, TriMesh};
