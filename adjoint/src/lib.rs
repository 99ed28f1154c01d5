//! Hand-derived differentiable kernels of hydrograd.

pub mod check;
pub mod drag;
pub mod kernel;
pub mod lie;
pub mod rigid;
pub mod step;
