#![doc = include_str!("../README.md")]

#[macro_use]
mod choices;

mod assembly;
pub mod boundary;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod contact;
pub mod coupling;
pub mod dynamics;
pub mod error;
pub mod geometry;
#[cfg(feature = "gpu")]
pub mod gpu;
mod memory;
pub mod multibody;
pub mod notation;
mod once;
#[cfg(feature = "opt")]
pub mod optimize;
#[cfg(feature = "output")]
pub mod output;
mod policy;
#[cfg(feature = "urdf")]
mod robot;
pub mod scene;
pub mod shape;
pub mod simulate;
pub mod solver;
mod special;
pub mod tradeoff;
mod water;

/// The book's programs are tested.
#[cfg(doctest)]
#[doc = include_str!("../docs/many-bodies.md")]
mod many_bodies {}

/// The same of another page.
#[cfg(doctest)]
#[doc = include_str!("../docs/gradients.md")]
mod gradients {}

/// The same of another page.
#[cfg(doctest)]
#[doc = include_str!("../docs/shapes.md")]
mod shapes {}

/// The same of a page whose programs need the feature.
#[cfg(all(doctest, feature = "opt"))]
#[doc = include_str!("../docs/control.md")]
mod control {}

pub use error::{Error, Result};
pub use geometry::{MassProperties, MeshReport, TriMesh};
pub use hydrograd_adjoint as adjoint;
pub use scene::{Body, BodyId, Fluid, Joint, Scene, Shape};
pub use simulate::{Controls, Fidelity, Gradient, Rollout, Settings, Simulator, objective};
