//! The GPU: any vendor's, through wgpu (feature `gpu`).
//!
//! `shaders/x.wgsl` computes what the CPU's function of [`source::SHADERS`] does. [`full`] is the backend of
//! [`crate::coupling::full`]: nothing of the size of a matrix is stored but the bodies' own factors, every entry of K
//! and P is made where it is used. [`reduced`] is [`crate::coupling::reduced`], for more bodies or points than a dense
//! system is made for; [`batch`] is the same for many equal scenes at once.
//!
//! Solves of [`full`] run in single precision inside an iterative refinement whose residuals, and all derivatives,
//! are in a *fine* arithmetic ([`source::Arithmetic`]): double precision where the adapter has it, two-float
//! numbers otherwise. Sums have a fixed order: one adapter gives the same bits for the same input.

pub mod batch;
mod buffer;
mod clock;
mod columns;
mod context;
mod factor;
pub mod full;
mod kernel;
mod lanczos;
pub mod panel;
mod pipeline;
mod placed;
mod points;
mod pool;
// For tests and benches alone.
#[doc(hidden)]
pub mod probe;
mod products;
pub mod reduced;
mod refined;
mod response;
mod rows;
pub mod source;
mod surfaces;
mod trial;
mod units;
mod wrenches;

pub use context::{Adapter, Context, Options, adapters};
pub use pool::Counts;
pub use source::Arithmetic;
