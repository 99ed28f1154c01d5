//! The command line as a person or a script meets it.

mod cache;
mod commands;
mod export;
mod formats;
mod interrupted;
mod tradeoff;

#[path = "../support/mod.rs"]
mod support;
