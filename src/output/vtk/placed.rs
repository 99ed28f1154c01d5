//! Bodies as they are drawn at a state.

use crate::adjoint::lie::Vec3;

/// A body at a state: its surface, or its origin if it has no shape, which counts as its one face.
#[derive(Clone)]
pub(super) struct Placed<'a> {
    pub body: usize,
    pub vertices: Vec<Vec3>,
    pub faces: Option<&'a [[usize; 3]]>,
}

impl Placed<'_> {
    /// How many it has.
    pub fn count(&self) -> usize {
        self.faces.map_or(1, <[_]>::len)
    }

    /// Of the faces.
    pub fn centers(&self) -> Vec<Vec3> {
        let center = |face: &[usize; 3]| face.iter().map(|i| self.vertices[*i]).sum::<Vec3>() / 3.0;
        match self.faces {
            Some(faces) => faces.iter().map(center).collect(),
            None => self.vertices.clone(),
        }
    }
}
