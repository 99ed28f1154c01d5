//! Edges at which a surface bends sharply, and the smooth sides between them.

use super::mesh::{Edge, TriMesh};
use hydrograd_adjoint::lie::Vec3;

/// How far apart the unit normals of neighbours are that lie in one plane, at most.
const FLAT: f64 = 1e-6;

impl TriMesh {
    /// Area of the largest part that is flat, m²: faces that share edges and lie in one plane. Of a round surface that is a face's.
    pub(crate) fn largest_flat(&self) -> f64 {
        let count = self.faces().len();
        let normals: Vec<Vec3> = (0..count).map(|f| self.normal(f)).collect();
        let mut beside = vec![Vec::new(); count];
        for Edge { faces: [a, b], .. } in self.edges() {
            if (normals[a] - normals[b]).norm() < FLAT {
                beside[a].push(b);
                beside[b].push(a);
            }
        }
        let (mut seen, mut largest) = (vec![false; count], 0.0_f64);
        for first in 0..count {
            let (mut open, mut area) = (vec![first], 0.0);
            while let Some(face) = open.pop() {
                if !std::mem::replace(&mut seen[face], true) {
                    area += self.area(face);
                    open.extend(&beside[face]);
                }
            }
            largest = largest.max(area);
        }
        largest
    }

    /// The edges across which the normal turns by more than `angle` (rad), in the order of [`TriMesh::edges`].
    pub fn sharp_edges(&self, angle: f64) -> Vec<Edge> {
        let cosine = angle.cos();
        let sharp = |e: &Edge| self.normal(e.faces[0]).dot(&self.normal(e.faces[1])) < cosine;
        self.edges().into_iter().filter(sharp).collect()
    }

    /// Length of the edges across which the normal turns by more than `angle` (rad), m.
    pub fn sharp_edge_length(&self, angle: f64) -> f64 {
        let length = |e: &Edge| {
            let [a, b] = e.vertices.map(|v| self.vertices()[v]);
            (a - b).norm()
        };
        self.sharp_edges(angle).iter().map(length).sum()
    }

    /// Faces around each vertex, grouped into the smooth sides that meet there: faces that share
    /// an edge at the vertex and bend by less than `sharp` (rad) across it belong together.
    pub(crate) fn smooth_sides(&self, sharp: f64) -> Vec<Vec<Vec<usize>>> {
        let normals: Vec<Vec3> = (0..self.faces().len()).map(|f| self.normal(f)).collect();
        let mut around = vec![Vec::new(); self.vertices().len()];
        for (i, t) in self.faces().iter().enumerate() {
            for k in t {
                around[*k].push(i);
            }
        }
        let smooth = |v: usize, a: usize, b: usize| {
            let shared = |k: &&usize| **k != v && self.faces()[b].contains(*k);
            self.faces()[a].iter().any(|k| shared(&k)) && normals[a].dot(&normals[b]) > sharp.cos()
        };
        let group = |(v, fan): (usize, &Vec<usize>)| {
            let mut left = fan.clone();
            let mut groups = Vec::new();
            while !left.is_empty() {
                let mut group = vec![left.remove(0)];
                let mut next = 0;
                while next < group.len() {
                    let from = group[next];
                    let (more, rest) = left.iter().partition(|f| smooth(v, from, **f));
                    let more: Vec<usize> = more;
                    group.extend(more);
                    left = rest;
                    next += 1;
                }
                groups.push(group);
            }
            groups
        };
        around.iter().enumerate().map(group).collect()
    }
}
