//! The command line as a person or a script meets it.

mod commands;
mod tradeoff;

#[path = "../support/mod.rs"]
mod support;
