//! One body in unbounded fluid, offline and once per shape, by one of several methods.
//!
//! All speak of the same flow: velocity −∇φ, density 1, body frame, body twists `ν = (u, ω)` about the
//! body's origin. [`mfs`] is what the coupled system of all bodies is built from; [`panel`] needs no
//! sources inside and converges evenly, so that two meshes tell its error; [`exact`] answers for
//! spheres and ellipsoids by formula; [`Response`] is what any method must answer for a body to be
//! compressed.

mod asymmetry;
pub mod exact;
pub mod mfs;
pub mod panel;
mod response;

pub use exact::ExactBoundary;
pub use mfs::{BodyBoundary, Depth, Method, MfsSettings, Readout, RowScaling, depth, readout};
pub(crate) use mfs::{solve_upper, solve_upper_transpose};
pub use panel::PanelBoundary;
pub use response::Response;
