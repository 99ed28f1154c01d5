//! Tests that read the source: what imports what, what it is built from, and shaders without a device.

mod circles;
mod dependencies;
mod docs;
mod graph;
mod layers;
mod manual;
mod shaders;
