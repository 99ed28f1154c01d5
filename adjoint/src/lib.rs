#![doc = include_str!("../README.md")]

mod blocks;
pub mod check;
pub mod contact;
#[doc(hidden)]
pub mod count;
pub mod drag;
mod draw;
pub mod kernel;
pub mod lie;
pub mod multipole;
mod registry;
pub mod revolve;
pub mod rigid;
pub mod sample;
pub mod solve;
pub mod step;
pub mod stream;
pub mod waterline;

pub use registry::rungs;
