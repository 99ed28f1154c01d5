//! Elements of a body's surface, fixed in the body's frame.

use super::panel::Panel;
use super::sum::TILE;
use crate::lie::Vec3;
use std::collections::HashMap;

/// Points of a surface with normals and row weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    pub(super) centre: Vec<Vec3>,
    normal: Vec<Vec3>,
    weight: Vec<f64>,
    /// Weight times normal.
    pub(super) weighted: Vec<Vec3>,
}

impl Points {
    /// From positions (m), outward unit normals and row weights (√A for scaled rows).
    pub fn new(centre: &[Vec3], normal: &[Vec3], weight: Vec<f64>) -> Self {
        assert_eq!(centre.len(), normal.len());
        assert_eq!(centre.len(), weight.len());
        Self {
            centre: centre.to_vec(),
            weighted: normal.iter().zip(&weight).map(|(n, w)| *w * n).collect(),
            normal: normal.to_vec(),
            weight,
        }
    }

    /// Points of no surface (m), as targets of the potential kernel alone: normals and weights zero.
    pub fn bare(points: &[Vec3]) -> Self {
        Self::new(
            points,
            &vec![Vec3::zeros(); points.len()],
            vec![0.0; points.len()],
        )
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

/// A directed edge of the surface, with what a sum needs of it beside the distances of its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    /// Its ends in the table of the tile.
    pub ends: [u32; 2],
    /// Its start.
    pub start: Vec3,
    /// End less start.
    pub along: Vec3,
    /// Its length squared.
    pub squared: f64,
}

/// The faces on both sides of an edge: the left one has it in its direction, the right one in the
/// other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sides {
    pub left: u32,
    /// [`NONE`] at a rim.
    pub right: u32,
}

/// A triangle, with what a sum needs of it beside the distances of its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Face {
    /// Its corners in the table of the tile.
    pub corners: [u32; 3],
    /// The first corner.
    pub first: Vec3,
    /// Twice the area times the outward normal, m².
    pub double_area: Vec3,
    /// Halved squares of the edges 01, 12, 20.
    pub half_squares: Vec3,
    /// Row weight.
    pub weight: f64,
}

/// Some consecutive faces or edges and the vertices they meet, so that the distances of a source
/// from the vertices are computed once and stay in the nearest cache.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tile<T> {
    pub vertices: Vec<Vec3>,
    pub items: Vec<T>,
}

/// A surface of triangles with row weights, and its edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    vertex: Vec<Vec3>,
    face: Vec<[usize; 3]>,
    weight: Vec<f64>,
    double_area: Vec<Vec3>,
    pub(super) faces: Vec<Tile<Face>>,
    pub(super) edges: Vec<Tile<Edge>>,
    pub(super) sides: Vec<Sides>,
    /// One a face.
    pub(super) panels: Vec<Panel>,
}

/// Faces of one tile.
pub(super) const FACES: usize = 64;

impl Triangles {
    /// From vertices (m), faces (counter-clockwise seen from outside) and row weights (1/√A for
    /// scaled rows, 1 for the plain flux). The surface need not be closed. Sums are fastest if
    /// neighbouring faces have neighbouring numbers.
    pub fn new(vertices: &[Vec3], faces: &[[usize; 3]], weights: Vec<f64>) -> Self {
        assert_eq!(faces.len(), weights.len());
        let double_area: Vec<Vec3> = faces
            .iter()
            .map(|&[a, b, c]| (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a])))
            .collect();
        let face_tiles = (0..faces.len())
            .step_by(FACES)
            .map(|start| {
                let mut table = Table::new(vertices);
                let items = (start..faces.len().min(start + FACES))
                    .map(|i| {
                        let [a, b, c] = faces[i].map(|v| vertices[v]);
                        Face {
                            corners: faces[i].map(|v| table.local(v)),
                            first: a,
                            double_area: double_area[i],
                            half_squares: 0.5
                                * Vec3::new(
                                    (b - a).norm_squared(),
                                    (c - b).norm_squared(),
                                    (a - c).norm_squared(),
                                ),
                            weight: weights[i],
                        }
                    })
                    .collect();
                table.finish(items)
            })
            .collect();
        let panels = faces.iter().zip(&weights);
        let panels = panels.map(|(f, w)| Panel::new(f.map(|v| vertices[v]), *w));
        let panels = panels.collect();
        let (ends, sides) = edges(faces);
        let edge_tiles = ends
            .chunks(TILE)
            .map(|ends| {
                let mut table = Table::new(vertices);
                let items = ends
                    .iter()
                    .map(|&[a, b]| {
                        let along = vertices[b] - vertices[a];
                        Edge {
                            ends: [table.local(a), table.local(b)],
                            start: vertices[a],
                            along,
                            squared: along.norm_squared(),
                        }
                    })
                    .collect();
                table.finish(items)
            })
            .collect();
        Self {
            vertex: vertices.to_vec(),
            face: faces.to_vec(),
            weight: weights,
            double_area,
            faces: face_tiles,
            edges: edge_tiles,
            sides,
            panels,
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
        self.face[i].map(|v| self.vertex[v])
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

/// The vertices of a tile while it is put together.
struct Table<'a> {
    all: &'a [Vec3],
    local: HashMap<usize, u32>,
    vertices: Vec<Vec3>,
}

impl<'a> Table<'a> {
    fn new(all: &'a [Vec3]) -> Self {
        Self {
            all,
            local: HashMap::new(),
            vertices: Vec::new(),
        }
    }

    fn local(&mut self, v: usize) -> u32 {
        *self.local.entry(v).or_insert_with(|| {
            self.vertices.push(self.all[v]);
            self.vertices.len() as u32 - 1
        })
    }

    fn finish<T>(self, items: Vec<T>) -> Tile<T> {
        Tile {
            vertices: self.vertices,
            items,
        }
    }
}

/// Every edge once, faces paired where one has `a → b` and another `b → a`; what finds no partner
/// (a rim, a face of the wrong orientation) stays an edge with no right face.
fn edges(faces: &[[usize; 3]]) -> (Vec<[usize; 2]>, Vec<Sides>) {
    let (mut ends, mut sides) = (Vec::new(), Vec::<Sides>::new());
    let mut open: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for (i, f) in faces.iter().enumerate() {
        for c in 0..3 {
            let (from, to) = (f[c], f[(c + 1) % 3]);
            if let Some(e) = open.get_mut(&[to, from]).and_then(Vec::pop) {
                sides[e].right = i as u32;
            } else {
                open.entry([from, to]).or_default().push(ends.len());
                ends.push([from, to]);
                sides.push(Sides {
                    left: i as u32,
                    right: NONE,
                });
            }
        }
    }
    (ends, sides)
}
