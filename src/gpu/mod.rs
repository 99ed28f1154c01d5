//! The GPU: any vendor's, through wgpu (feature `gpu`).
//!
//! `shaders/x.wgsl` computes what the CPU's function of [`source::SHADERS`] does; its wrapper is `x.rs`
//! here. [`full`] is the backend of [`crate::coupling::full`]: nothing of the size of a matrix is stored
//! but the bodies' own factors, every entry of K and P is made where it is used. [`reduced`] is
//! [`crate::coupling::reduced`], for more bodies or points than a dense system is made for.
//!
//! Solves of [`full`] run in single precision inside an iterative refinement whose residuals, and all derivatives,
//! are in a *fine* arithmetic ([`source::Arithmetic`]): double precision where the adapter has it, two-float
//! numbers otherwise. Sums have a fixed order: one adapter gives the same bits for the same input.

mod apply;
mod apply_jvp;
mod apply_transpose;
mod apply_transpose_jvp;
mod blocks;
mod buffer;
mod cgls;
mod combine;
mod conjugate;
mod context;
mod coulomb;
mod coulomb_hvp;
mod coulomb_jvp;
mod coulomb_vjp;
mod diagonal;
mod factor;
pub mod full;
mod geometry;
mod impulse;
mod kernel;
mod pair_hvp;
mod pair_vjp;
mod pass;
mod pipeline;
mod place;
mod placed;
mod points;
mod pool;
mod products;
mod reduce;
pub mod reduced;
mod refine;
mod rows;
mod share;
pub mod source;
mod sum;
mod trial;
mod units;
mod wrench;

pub use context::{Adapter, Context, Counts, Options, adapters};
pub use source::Arithmetic;
