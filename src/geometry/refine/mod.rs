//! Finer faces where a body comes near others.
//!
//! Faces that touch a region (a ball) are split at their longest edges until these are short enough; around
//! it the mesh grows coarser from ring to ring. See [`bisection`] for how, and [`ExactSurface`] for curved parts.

mod bisection;
mod exact;
mod regions;

pub use exact::ExactSurface;
pub use regions::{MAX_ADDED_FACES, Refinement, refine, validate_refinements};
