//! Which face of a mesh a point lies at.

use super::mesh::TriMesh;
use super::tree::MeshTree;
use crate::adjoint::lie::Vec3;

/// The faces of a surface, ready to be asked which is nearest to a point.
pub(crate) struct Beneath(MeshTree);

impl Beneath {
    /// Of vertices (m) and the numbers of each face's corners among them.
    pub fn new(vertices: &[Vec3], corners: impl Iterator<Item = [usize; 3]>) -> Self {
        let mesh = TriMesh::with_parts("panels", vertices.to_vec(), corners.collect());
        Self(MeshTree::new(&mesh))
    }

    /// Number of the face nearest to a point (m).
    pub fn face(&self, point: &Vec3) -> usize {
        let (_, face) = self.0.closest(point);
        self.0.numbers[face]
    }
}
