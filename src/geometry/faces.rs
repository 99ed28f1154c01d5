//! The faces of a mesh, with their geometry.

use super::mesh::TriMesh;
use hydrograd_adjoint::lie::{Vec3, Vec6, six};

/// Flat faces of a closed surface, body frame.
#[derive(Clone, Debug)]
pub struct Faces {
    /// Corners, m, counter-clockwise seen from the fluid.
    pub corners: Vec<[Vec3; 3]>,
    /// Centroids, m.
    pub centres: Vec<Vec3>,
    /// Unit normals into the fluid.
    pub normals: Vec<Vec3>,
    /// Areas, m².
    pub areas: Vec<f64>,
}

impl Faces {
    /// Those of a mesh.
    pub fn of(mesh: &TriMesh) -> Self {
        let all = || 0..mesh.faces().len();
        let corners: Vec<[Vec3; 3]> = all().map(|f| mesh.corners(f)).collect();
        Self {
            centres: corners.iter().map(|[a, b, c]| (a + b + c) / 3.0).collect(),
            normals: all().map(|f| mesh.normal(f)).collect(),
            areas: all().map(|f| mesh.area(f)).collect(),
            corners,
        }
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.areas.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty()
    }

    /// Flux through face `i` per unit twist, `∫ n·(u + ω × x) dA`, m³/s (exact: the centroid's
    /// value times the area).
    pub fn twist_flux(&self, i: usize) -> Vec6 {
        let n = self.normals[i] * self.areas[i];
        six(&n, &self.centres[i].cross(&n))
    }

    /// Volume inside, m³.
    pub fn volume(&self) -> f64 {
        self.corners
            .iter()
            .map(|[a, b, c]| a.dot(&b.cross(c)) / 6.0)
            .sum()
    }

    /// Area of all, m².
    pub fn area(&self) -> f64 {
        self.areas.iter().sum()
    }
}

/// Edge of an equilateral triangle of this area.
pub(crate) fn equilateral_edge(area: f64) -> f64 {
    (4.0 * area / 3.0_f64.sqrt()).sqrt()
}
