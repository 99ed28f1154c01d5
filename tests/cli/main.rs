//! The command line as a person or a script meets it.

mod cache;
mod commands;
mod export;
mod filmed_gaps;
mod formats;
mod interrupted;
mod tradeoff;
mod video;

#[path = "../support/mod.rs"]
mod support;
