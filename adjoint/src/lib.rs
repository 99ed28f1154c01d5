//! Hand-derived differentiable kernels of hydrograd.

pub mod drag;
pub mod lie;
pub mod rigid;
