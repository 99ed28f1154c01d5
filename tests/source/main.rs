//! Tests that read the source: what imports what, and shaders without a device.

mod circles;
mod docs;
mod graph;
mod layers;
mod manual;
mod shaders;
