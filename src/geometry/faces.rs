//! The faces of a mesh, with their geometry.

use super::mesh::TriMesh;
use hydrograd_adjoint::lie::{Vec3, Vec6, angular, linear, six};

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

    /// ∂f/∂v_k of the flux `f = ∫ n·(u + ω × x) dA` of a twist through face `i`, with its corners: m²/s per unit of the twist.
    pub fn twist_flux_slopes(&self, i: usize, twist: &Vec6) -> [Vec3; 3] {
        let turn = angular(twist);
        let velocity = linear(twist) + turn.cross(&self.centres[i]);
        // The corners move the area vector and, each by a third, the centroid.
        let moved = (self.areas[i] / 3.0) * self.normals[i].cross(&turn);
        self.opposite(i).map(|e| moved - 0.5 * e.cross(&velocity))
    }

    /// ∂A/∂v_k of the area of face `i` with its corners, m.
    pub fn area_slopes(&self, i: usize) -> [Vec3; 3] {
        self.opposite(i).map(|e| 0.5 * self.normals[i].cross(&e))
    }

    /// Rate of the area of all, m²/s, for velocities of the corners of each face, m/s.
    pub fn area_rate(&self, velocity: impl Fn(usize, usize) -> Vec3) -> f64 {
        let of = |i: usize| {
            let slopes = self.area_slopes(i).into_iter().enumerate();
            slopes.map(|(k, s)| s.dot(&velocity(i, k))).sum::<f64>()
        };
        (0..self.len()).map(of).sum()
    }

    /// Rate of the volume inside, m³/s, for those.
    pub fn volume_rate(&self, velocity: impl Fn(usize, usize) -> Vec3) -> f64 {
        let of = |i: usize| {
            let mean = (velocity(i, 0) + velocity(i, 1) + velocity(i, 2)) / 3.0;
            self.areas[i] * self.normals[i].dot(&mean)
        };
        (0..self.len()).map(of).sum()
    }

    /// Edges of face `i` opposite of its corners, from the next one to the one after.
    fn opposite(&self, i: usize) -> [Vec3; 3] {
        let [a, b, c] = self.corners[i];
        [c - b, a - c, b - a]
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
