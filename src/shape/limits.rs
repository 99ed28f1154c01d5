//! How many faces a shape may have.

/// Faces of a shape that doesn't ask for a number: four times refined icosahedron for spheres.
pub const DEFAULT_FACES: usize = 1280;
/// Most faces that a shape may ask for.
pub const MAX_FACES: usize = 4_000_000;
