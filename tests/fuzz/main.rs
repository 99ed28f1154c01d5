//! What a user or a stranger can hand over, changed by chance: scene files, meshes, cached bodies, trajectories, shapes in a word.
//!
//! Whatever an input is, it is taken or refused with an error: a panic, more than 60 s, more than 3 GB, or a number that isn't finite in
//! a result without an error fails. What was found once stands in `corpus/` beside what inputs are made from.
//!
//! `cargo test --release --test fuzz` takes a fixed number of inputs of each target. A night's run, other inputs each time, that says how many
//! a second: `HYDROGRAD_FUZZ_SECONDS=28800 cargo test --release --test fuzz -- --nocapture`; `HYDROGRAD_FUZZ_INPUTS=1000000` gives
//! each target so many instead, `HYDROGRAD_FUZZ_SEED=7` other ones. What fails is written to `target/fuzz/`; `HYDROGRAD_FUZZ_FILE=FILE` gives
//! every target that one input.

mod cache;
mod engine;
mod limits;
mod meshes;
mod mutate;
mod resumed;
#[cfg(feature = "urdf")]
mod robots;
mod scenes;
mod words;

#[path = "../support/mod.rs"]
mod support;

#[global_allocator]
static ALLOCATOR: limits::Counting = limits::Counting;
