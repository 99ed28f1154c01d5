//! Splitting triangles at the middle of their longest edges.
//!
//! An edge may be split where it is the longest of both its triangles. Where it isn't, the neighbour's longest
//! edge comes first, and so on: a path of ever longer edges, which ends. So no vertex ever lies on the
//! inside of an edge, and on flat ground no angle falls under half the smallest one before.
//!
//! # References
//! M.-C. Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid techniques",
//! Int. J. Numer. Methods Eng. 20 (1984) 745–756, and "New longest-edge algorithms for the refinement and/or
//! improvement of unstructured triangulations", ibid. 40 (1997) 3313–3324. The bound: I. G. Rosenberg,
//! F. Stenger, "A lower bound on the angles of triangles constructed by bisecting the longest side",
//! Math. Comp. 29 (1975) 390–395.

use super::exact::ExactSurface;
use crate::geometry::mesh::TriMesh;
use hydrograd_adjoint::lie::Vec3;
use std::collections::HashMap;

/// Mean area of faces over the longest edge asked for squared, as found with bodies of all kinds.
pub(super) const MEAN_AREA: f64 = 0.18;

/// What an edge is known by: its vertices, the smaller number first.
pub(super) fn key(a: usize, b: usize) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// An edge with its length, ordered by it. Equal lengths are told apart by the vertices: a strict order, or
/// paths of ever longer edges might run in circles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeLength {
    /// Bits of positive numbers sort as the numbers do.
    squared: u64,
    /// The smaller number first.
    pub ends: [usize; 2],
}

impl EdgeLength {
    pub fn squared(&self) -> f64 {
        f64::from_bits(self.squared)
    }
}

/// A closed mesh whose triangles can be split.
pub(super) struct Bisection {
    pub vertices: Vec<Vec3>,
    pub faces: Vec<[usize; 3]>,
    /// Whether each face stands for a curved part.
    curved: Vec<bool>,
    exact: ExactSurface,
    /// The two faces of each edge, by its [`key`].
    pub sides: HashMap<[usize; 2], [usize; 2]>,
}

impl Bisection {
    /// Of a mesh and the surface that it stands for.
    pub fn new(mesh: &TriMesh, exact: ExactSurface) -> Self {
        let sides = mesh.edges().into_iter().map(|e| {
            let [a, b] = e.vertices;
            (key(a, b), e.faces)
        });
        let all = 0..mesh.faces().len();
        Self {
            sides: sides.collect(),
            curved: all.map(|f| exact.curved(&mesh.corners(f))).collect(),
            exact,
            vertices: mesh.vertices().to_vec(),
            faces: mesh.faces().to_vec(),
        }
    }

    pub fn corners(&self, f: usize) -> [Vec3; 3] {
        self.faces[f].map(|v| self.vertices[v])
    }

    pub fn is_curved(&self, f: usize) -> bool {
        self.curved[f]
    }

    /// The longest edge of a face.
    pub fn longest(&self, f: usize) -> EdgeLength {
        let [a, b, c] = self.faces[f];
        let edge = |a: usize, b: usize| EdgeLength {
            squared: (self.vertices[b] - self.vertices[a])
                .norm_squared()
                .to_bits(),
            ends: key(a, b),
        };
        edge(a, b).max(edge(b, c)).max(edge(c, a))
    }

    /// Splits the edge that the path from face `f` ends at, and names the four faces of that edge.
    pub fn advance(&mut self, f: usize) -> [usize; 4] {
        let mut at = f;
        let mut edge = self.longest(at);
        loop {
            let [first, second] = self.sides[&edge.ends];
            let other = if first == at { second } else { first };
            let longer = self.longest(other);
            if longer <= edge {
                return self.split(edge.ends, [at, other]);
            }
            (at, edge) = (other, longer);
        }
    }

    /// Splits an edge and its two faces.
    pub fn split(&mut self, ends: [usize; 2], faces: [usize; 2]) -> [usize; 4] {
        let [a, b] = ends.map(|v| self.vertices[v]);
        let mut middle = a + (b - a) * 0.5;
        if faces.iter().any(|f| self.curved[*f]) {
            middle = self.exact.onto(&middle);
        }
        let m = self.vertices.len();
        self.vertices.push(middle);
        let added = [self.faces.len(), self.faces.len() + 1];
        for (f, new) in faces.into_iter().zip(added) {
            // The face keeps the first end, the new one gets the second; both run around as before.
            let swap = |old: usize| self.faces[f].map(|v| if v == old { m } else { v });
            let (near, far) = (swap(ends[1]), swap(ends[0]));
            let apex = near.into_iter().find(|v| *v != m && *v != ends[0]);
            self.faces[f] = near;
            self.faces.push(far);
            self.curved.push(self.curved[f]);
            // A triangle has a third corner.
            let apex = apex.unwrap_or(m);
            self.sides.insert([apex, m], [f, new]);
            let outer = key(apex, ends[1]);
            if let Some(beside) = self.sides.get_mut(&outer) {
                *beside = beside.map(|g| if g == f { new } else { g });
            }
        }
        self.sides.remove(&ends);
        self.sides.insert([ends[0], m], faces);
        self.sides.insert([ends[1], m], added);
        [faces[0], faces[1], added[0], added[1]]
    }
}
