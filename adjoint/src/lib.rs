#![doc = include_str!("../README.md")]

pub mod check;
pub mod contact;
pub mod drag;
pub mod kernel;
pub mod lie;
mod registry;
pub mod rigid;
pub mod sample;
pub mod step;

pub use registry::rungs;
