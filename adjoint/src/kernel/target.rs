//! Elements of a body's surface, fixed in the body's frame.

use crate::lie::Vec3;
use std::collections::HashMap;

/// Points of a surface with normals and row weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    pub(super) centre: Vec<Vec3>,
    pub(super) normal: Vec<Vec3>,
    pub(super) weight: Vec<f64>,
}

impl Points {
    /// From positions (m), outward unit normals and row weights (√A for scaled rows).
    pub fn new(centre: &[Vec3], normal: &[Vec3], weight: Vec<f64>) -> Self {
        assert_eq!(centre.len(), normal.len());
        assert_eq!(centre.len(), weight.len());
        Self {
            centre: centre.to_vec(),
            normal: normal.to_vec(),
            weight,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.centre.len()
    }

    /// No points.
    pub fn is_empty(&self) -> bool {
        self.centre.is_empty()
    }

    /// Positions, m.
    pub fn centres(&self) -> &[Vec3] {
        &self.centre
    }

    /// Outward unit normals.
    pub fn normals(&self) -> &[Vec3] {
        &self.normal
    }

    /// Row weights.
    pub fn weights(&self) -> &[f64] {
        &self.weight
    }
}

/// No face on this side of an edge.
pub(super) const NONE: u32 = u32::MAX;

/// A directed edge `from → to` of the surface; the left face has it in this direction, the right
/// one in the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    pub from: u32,
    pub to: u32,
    pub left: u32,
    pub right: u32,
}

/// A surface of triangles with row weights, and its edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    pub(super) vertex: Vec<Vec3>,
    pub(super) face: Vec<[u32; 3]>,
    /// Twice the area times the outward normal, m².
    pub(super) double_area: Vec<Vec3>,
    pub(super) weight: Vec<f64>,
    pub(super) edge: Vec<Edge>,
}

impl Triangles {
    /// From vertices (m), faces (counter-clockwise seen from outside) and row weights (1/√A for
    /// scaled rows, 1 for the plain flux). The surface need not be closed.
    pub fn new(vertices: &[Vec3], faces: &[[usize; 3]], weights: Vec<f64>) -> Self {
        assert_eq!(faces.len(), weights.len());
        let face: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|v| v as u32)).collect();
        let double_area = faces
            .iter()
            .map(|&[a, b, c]| (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a])))
            .collect();
        Self {
            vertex: vertices.to_vec(),
            double_area,
            weight: weights,
            edge: edges(&face),
            face,
        }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.face.len()
    }

    /// No triangles.
    pub fn is_empty(&self) -> bool {
        self.face.is_empty()
    }

    /// Corners of triangle `i`, m.
    pub fn corners(&self, i: usize) -> [Vec3; 3] {
        self.face[i].map(|v| self.vertex[v as usize])
    }

    /// Outward unit normal of triangle `i`.
    pub fn normal(&self, i: usize) -> Vec3 {
        self.double_area[i].normalize()
    }

    /// Area of triangle `i`, m².
    pub fn area(&self, i: usize) -> f64 {
        0.5 * self.double_area[i].norm()
    }

    /// Centroid of triangle `i`, m.
    pub fn centroid(&self, i: usize) -> Vec3 {
        let [a, b, c] = self.corners(i);
        (a + b + c) / 3.0
    }

    /// Row weights.
    pub fn weights(&self) -> &[f64] {
        &self.weight
    }
}

/// Every edge once, faces paired where one has `a → b` and another `b → a`; what finds no partner
/// (a rim, a wrongly turned face) stays an edge with no right face.
fn edges(face: &[[u32; 3]]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::with_capacity(face.len() * 3 / 2);
    let mut open: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
    for (i, f) in face.iter().enumerate() {
        for c in 0..3 {
            let (from, to) = (f[c], f[(c + 1) % 3]);
            if let Some(e) = open.get_mut(&(to, from)).and_then(Vec::pop) {
                edges[e].right = i as u32;
            } else {
                open.entry((from, to)).or_default().push(edges.len());
                edges.push(Edge {
                    from,
                    to,
                    left: i as u32,
                    right: NONE,
                });
            }
        }
    }
    edges
}
