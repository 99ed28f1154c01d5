//! Contact of bodies with one another and with walls, and joints at their limits.

mod drops;
mod geometry;
mod integrators;
mod joints;
mod passing;
mod physics;
mod pieces;
mod standard;
mod tools;

#[path = "../support/mod.rs"]
mod support;
