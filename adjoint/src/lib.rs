//! Hand-derived differentiable kernels of hydrograd.

pub mod check;
pub mod kernel;
pub mod lie;
