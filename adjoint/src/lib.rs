//! Hand-derived differentiable kernels of hydrograd.

pub mod lie;
