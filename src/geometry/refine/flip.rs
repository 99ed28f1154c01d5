//! Other diagonals of flat quadrilaterals: the same surface in better shaped faces.
//!
//! Where two faces lie in one plane, their common edge is swapped for the other diagonal if the angles opposite to it come to more than
//! π, until none do: the Delaunay triangulation of each flat part between its edges.
//!
//! # References
//! C. L. Lawson, "Software for C¹ surface interpolation", in Mathematical Software III, Academic Press 1977, 161–194.

use super::bisection::{Bisection, key};
use hydrograd_adjoint::lie::Vec3;

/// How far out of their plane two faces may bend and be flat, over their longest edge: rounding of coordinates in single precision.
const FLAT: f64 = 1e-6;
/// Cotangents under whose sum an edge is flipped: corners on one circle leave a choice, which rounding shouldn't make.
const OBTUSE: f64 = -1e-6;

/// The three edges of a face.
pub(super) fn edges([a, b, c]: [usize; 3]) -> [[usize; 2]; 3] {
    [key(a, b), key(b, c), key(c, a)]
}

/// Two faces about an edge: the first runs from `a` to `b` to `c`, the second from `b` to `a` to `d`.
struct Pair {
    faces: [usize; 2],
    corners: [usize; 4],
}

impl Bisection {
    fn pair(&self, ends: [usize; 2]) -> Option<Pair> {
        let faces = *self.sides.get(&ends)?;
        let [first, second] = faces.map(|f| self.faces[f]);
        let apex = |face: [usize; 3]| face.into_iter().find(|v| !ends.contains(v));
        let (c, d) = (apex(first)?, apex(second)?);
        let at = first.into_iter().position(|v| v == c)?;
        let (a, b) = (first[(at + 1) % 3], first[(at + 2) % 3]);
        Some(Pair {
            faces,
            corners: [a, b, c, d],
        })
    }

    /// Whether the two faces of an edge lie in one plane.
    pub fn is_flat(&self, ends: [usize; 2]) -> bool {
        let flat = |pair: &Pair| {
            let [a, b, c, d] = pair.corners.map(|v| self.vertices[v]);
            let normals = [(b - a).cross(&(c - a)), (a - b).cross(&(d - b))];
            let [one, other] = normals.map(|n| n.normalize());
            let sides = [b - a, c - a, c - b, d - a, d - b].map(|e| e.norm());
            let size = sides.into_iter().fold(0.0, f64::max);
            let out = one.dot(&(d - a)).abs().max(other.dot(&(c - a)).abs());
            one.dot(&other) > 0.0 && out <= FLAT * size
        };
        self.pair(ends).as_ref().is_some_and(flat)
    }

    /// Flips what should be among these edges, and what should be then, and names the faces that changed.
    pub fn flip_all(&mut self, mut open: Vec<[usize; 2]>) -> Vec<usize> {
        let mut changed = Vec::new();
        while let Some(ends) = open.pop() {
            let Some(pair) = self.pair(ends) else {
                continue;
            };
            if self.should_flip(ends, &pair) {
                let [a, b, c, d] = pair.corners;
                self.flip(ends, &pair);
                changed.extend(pair.faces);
                open.extend([key(c, a), key(a, d), key(d, b), key(b, c)]);
            }
        }
        changed
    }

    fn should_flip(&self, ends: [usize; 2], pair: &Pair) -> bool {
        let [a, b, c, d] = pair.corners;
        let [x, y] = [a, b].map(|v| self.vertices[v]);
        let cotangent = |apex: usize| {
            let [to, from] = [x, y].map(|end: Vec3| end - self.vertices[apex]);
            to.dot(&from) / to.cross(&from).norm()
        };
        cotangent(c) + cotangent(d) < OBTUSE
            && !self.sides.contains_key(&key(c, d))
            && self.is_flat(ends)
    }

    fn flip(&mut self, ends: [usize; 2], pair: &Pair) {
        let ([a, b, c, d], [f, g]) = (pair.corners, pair.faces);
        self.faces[f] = [c, a, d];
        self.faces[g] = [d, b, c];
        self.sides.remove(&ends);
        self.sides.insert(key(c, d), [f, g]);
        for (edge, from, to) in [(key(a, d), g, f), (key(b, c), f, g)] {
            if let Some(beside) = self.sides.get_mut(&edge) {
                *beside = beside.map(|h| if h == from { to } else { h });
            }
        }
    }
}
