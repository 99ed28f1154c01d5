//! Meshes whose faces are too long for what they should resolve.

use crate::geometry::{TriMesh, divided};

/// Times the edges of as many faces as asked for that a mesh's may be long.
const LONG: f64 = 3.0;
/// Most faces that dividing adds, over the number asked for: slivers, of which it makes many before they are short, come to an end there.
const ADDED: usize = 2;

/// How long the edges of a mesh are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edges {
    /// The longest one, m.
    pub longest: f64,
    /// The longest one of as many faces as asked for, m.
    pub asked: f64,
}

impl Edges {
    /// Of a mesh of which so many faces are asked for.
    pub fn of(mesh: &TriMesh, faces: usize) -> Self {
        Self {
            longest: mesh.longest_edge(),
            asked: mesh.edge_of(faces),
        }
    }

    /// Whether some are far too long.
    pub fn are_long(&self) -> bool {
        self.longest > LONG * self.asked
    }
}

/// The same surface with faces as short as those of as many as asked for, or nearly so where that takes too many; none where the mesh is
/// as fine as it should be.
pub(crate) fn divide(mesh: &TriMesh, faces: usize) -> Option<TriMesh> {
    let edges = Edges::of(mesh, faces);
    let most = mesh.faces().len() + ADDED * faces;
    edges.are_long().then(|| divided(mesh, edges.asked, most))
}
