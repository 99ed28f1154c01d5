//! What is wrong with a mesh, where, and what to do about it.
//!
//! All thresholds are relative to the mesh itself, so a verdict doesn't depend on the unit of
//! length. Self-intersection (a face that passes through another) is *not* looked for: it
//! needs a spatial search and exact predicates, and a mesh tool is the place for it.

mod report;
mod scan;

pub use report::{Finding, Kind, MeshReport, Severity};
pub use scan::check_parts;
