//! Tests that read the source: what imports what, and shaders without a device.

mod circles;
mod graph;
mod layers;
mod shaders;
