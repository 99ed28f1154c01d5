//! Shapes by formula, as meshes: vertices on the exact surface, faces near-equilateral, and
//! mirror images of each other in x, y and z (prisms: in x), so that the mesh adds no coupling that
//! the shape doesn't have.

pub(super) mod cuboid;
mod layout;
mod planar;
pub(super) mod prism;
pub(super) mod revolved;
pub(super) mod sphere;
