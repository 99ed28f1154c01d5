//! A run as files that other programs open: [`vtk`] for ParaView, [`gltf`] for Blender and whatever else shows a scene.
//!
//! Nothing is computed that a [`Rollout`](crate::simulate::Rollout) doesn't tell already. Lengths are metres, times seconds, and z points up in VTK, whose axes are those of the world; in
//! glTF, where y does, a node above all bodies turns it. Every file appears whole: it is written beside its place and then renamed.

mod frames;
pub mod gltf;
mod room;
pub mod vtk;

pub use frames::Frames;
