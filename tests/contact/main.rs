//! Contact of bodies with one another and with walls, and joints at their limits.

mod drops;
mod flat;
mod flush;
mod geometry;
mod heaps;
mod held;
mod integrators;
mod joints;
mod parts;
mod passing;
mod physics;
mod pieces;
mod pressed;
mod resistance;
mod standard;
mod thin;
mod tools;
mod wet;

#[path = "../support/mod.rs"]
mod support;
