//! What parsers return.

use hydrograd_adjoint::lie::Vec3;
use serde::Serialize;

/// What was done to a file's contents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Repairs {
    /// Polygons with more than three corners that were split into triangles.
    pub polygons_split: usize,
    /// Vertices merged with one of exactly the same coordinates.
    pub merged_same: usize,
    /// Vertices merged with one nearby (within 1e-6 of the diameter, or the coordinates' single
    /// precision).
    pub merged_near: usize,
    /// Faces that had no area after the merge and were left out.
    pub collapsed: usize,
}

/// What a parser returns: vertices in file units, triangles with any index.
#[derive(Default)]
pub(super) struct Raw {
    pub vertices: Vec<Vec3>,
    pub faces: Vec<[usize; 3]>,
    pub repairs: Repairs,
}

/// What is wrong with the contents, and the remedy.
pub(super) type Parsed = std::result::Result<Raw, String>;

/// A message or line of a file on one line, and not longer than a reader reads.
pub(super) fn brief(text: &str) -> String {
    let mut line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((end, _)) = line.char_indices().nth(200) {
        line.truncate(end);
        line.push('…');
    }
    line
}
