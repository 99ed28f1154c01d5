//! Tests that read the source: what imports what, and shaders without a device.

mod layers;
mod shaders;
