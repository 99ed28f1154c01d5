//! The surface of a mesh with more faces, or with fewer.

use super::mesh::TriMesh;
use super::points::area_vector;
use crate::error::Result;
use hydrograd_adjoint::lie::{Mat3, Vec3};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Distance along the surface counts as this part of the distance from it: on flat ground edges come
/// out even.
const EVEN: f64 = 1e-2;
/// Cosine of the most that a face's normal may turn at once.
const TURN: f64 = 0.3;
/// Least height of a face over its longest edge.
const SLIVER: f64 = 0.05;

impl TriMesh {
    /// The same polyhedron with every face split into four at the middles of its edges.
    pub fn split(&self) -> Self {
        let mut vertices = self.vertices().to_vec();
        let mut known: HashMap<[usize; 2], usize> = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *known.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                vertices.push(vertices[a] + (vertices[b] - vertices[a]) * 0.5);
                vertices.len() - 1
            })
        };
        let mut faces = Vec::with_capacity(4 * self.faces().len());
        for &[a, b, c] in self.faces() {
            let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
            faces.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        Self::with_parts(self.name(), vertices, faces)
    }

    /// The same faces with every vertex moved by a few parts of an edge.
    pub(crate) fn moved(&self, to: impl Fn(&Vec3) -> Vec3) -> Self {
        let vertices = self.vertices().iter().map(to).collect();
        Self::with_parts(self.name(), vertices, self.faces().to_vec())
    }

    /// Nearly the same surface with about `target` faces, or as few as it can lose without folding:
    /// edges are collapsed one after the other, where the surface moves least.
    ///
    /// # Errors
    /// [`Error::Mesh`](crate::Error::Mesh) where the result isn't a surface any more.
    ///
    /// # References
    /// M. Garland, P. S. Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997,
    /// 209–216.
    pub fn coarsened(&self, target: usize) -> Result<Self> {
        let mut collapse = Collapse::new(self);
        collapse.reduce(target);
        let (vertices, faces) = collapse.parts();
        Self::new(self.name(), vertices, faces)
    }
}

/// Weighted sum of squared distances from planes, `xᵀ a x + 2 b·x + c`.
#[derive(Clone, Copy, Default)]
struct Quadric {
    a: Mat3,
    b: Vec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    fn plane(corners: &[Vec3; 3]) -> Self {
        let area = area_vector(corners);
        let weight = area.norm();
        let n = area / weight;
        let d = -n.dot(&corners[0]);
        Self {
            a: weight * n * n.transpose(),
            b: weight * d * n,
            c: weight * d * d,
            weight,
        }
    }

    fn add(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
        self.weight += other.weight;
    }

    /// The best point between `from` and `to`, and what it costs.
    fn best(&self, from: &Vec3, to: &Vec3) -> (Vec3, f64) {
        let middle = 0.5 * (from + to);
        let pull = EVEN * EVEN * self.weight;
        let matrix = self.a + pull * Mat3::identity();
        let solved = matrix
            .cholesky()
            .map(|m| m.solve(&(pull * middle - self.b)));
        let x = solved.unwrap_or(middle);
        let planes = x.dot(&(self.a * x)) + 2.0 * self.b.dot(&x) + self.c;
        (x, planes.max(0.0) + pull * (from - to).norm_squared())
    }
}

/// An edge that may be collapsed: the cost (bits of positive numbers sort as the numbers do), its ends, the
/// smaller number first, and how often these had moved. The cheapest is the greatest.
type Candidate = Reverse<(u64, [usize; 2], [u32; 2])>;

/// A surface that loses faces.
struct Collapse {
    vertices: Vec<Vec3>,
    faces: Vec<Option<[usize; 3]>>,
    /// Faces at each vertex.
    around: Vec<Vec<usize>>,
    quadrics: Vec<Quadric>,
    moved: Vec<u32>,
    left: usize,
    queue: BinaryHeap<Candidate>,
    /// Lengths are in units of the body's size, about its middle.
    size: f64,
    middle: Vec3,
}

impl Collapse {
    fn new(mesh: &TriMesh) -> Self {
        let [low, high] = mesh.bounds();
        let (middle, size) = (0.5 * (low + high), mesh.diameter());
        let vertices: Vec<Vec3> = (mesh.vertices().iter())
            .map(|v| (v - middle) / size)
            .collect();
        let mut around = vec![Vec::new(); vertices.len()];
        let mut quadrics = vec![Quadric::default(); vertices.len()];
        for (f, face) in mesh.faces().iter().enumerate() {
            let plane = Quadric::plane(&face.map(|v| vertices[v]));
            for v in face {
                around[*v].push(f);
                quadrics[*v].add(&plane);
            }
        }
        let mut out = Self {
            moved: vec![0; vertices.len()],
            vertices,
            faces: mesh.faces().iter().copied().map(Some).collect(),
            around,
            quadrics,
            left: mesh.faces().len(),
            queue: BinaryHeap::new(),
            size,
            middle,
        };
        for edge in mesh.edges() {
            out.consider(edge.vertices);
        }
        out
    }

    fn consider(&mut self, ends: [usize; 2]) {
        let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let (_, cost) = self.best(ends);
        let moved = ends.map(|v| self.moved[v]);
        self.queue.push(Reverse((cost.to_bits(), ends, moved)));
    }

    /// The place that an edge goes to, and what that costs.
    fn best(&self, [a, b]: [usize; 2]) -> (Vec3, f64) {
        let mut quadric = self.quadrics[a];
        quadric.add(&self.quadrics[b]);
        quadric.best(&self.vertices[a], &self.vertices[b])
    }

    fn reduce(&mut self, target: usize) {
        while self.left > target.max(4) {
            let Some(Reverse((_, ends, moved))) = self.queue.pop() else {
                return;
            };
            let [a, b] = ends;
            if ends.map(|v| self.moved[v]) != moved || !self.joined(a, b) {
                continue;
            }
            let (place, _) = self.best(ends);
            if self.may_collapse(a, b, &place) {
                self.collapse(a, b, place);
            }
        }
    }

    fn face(&self, f: usize) -> [usize; 3] {
        self.faces[f].unwrap_or([usize::MAX; 3])
    }

    fn joined(&self, a: usize, b: usize) -> bool {
        self.around[a].iter().any(|f| self.face(*f).contains(&b))
    }

    fn neighbours(&self, v: usize) -> Vec<usize> {
        let corners = self.around[v].iter().flat_map(|f| self.face(*f));
        let mut out: Vec<usize> = corners.filter(|w| *w != v).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Whether the surface stays one that doesn't fold.
    fn may_collapse(&self, a: usize, b: usize, place: &Vec3) -> bool {
        let (near_a, near_b) = (self.neighbours(a), self.neighbours(b));
        let common: Vec<usize> = near_a.into_iter().filter(|v| near_b.contains(v)).collect();
        if common.len() != 2 || common.iter().any(|v| self.around[*v].len() < 4) {
            return false;
        }
        let stays = |v: usize, other: usize| {
            self.around[v].iter().all(|f| {
                let face = self.face(*f);
                if face.contains(&other) {
                    return true;
                }
                let before = face.map(|w| self.vertices[w]);
                let after = face.map(|w| if w == v { *place } else { self.vertices[w] });
                let (old, new) = (area_vector(&before), area_vector(&after));
                let longest = (0..3)
                    .map(|k| (after[(k + 1) % 3] - after[k]).norm_squared())
                    .fold(0.0, f64::max);
                old.dot(&new) > TURN * old.norm() * new.norm()
                    && 2.0 * new.norm() > SLIVER * longest
            })
        };
        stays(a, b) && stays(b, a)
    }

    fn collapse(&mut self, a: usize, b: usize, place: Vec3) {
        for f in std::mem::take(&mut self.around[b]) {
            let face = self.face(f);
            if face.contains(&a) {
                self.faces[f] = None;
                self.left -= 1;
                for v in face {
                    self.around[v].retain(|g| *g != f);
                }
            } else {
                self.faces[f] = Some(face.map(|v| if v == b { a } else { v }));
                self.around[a].push(f);
            }
        }
        let quadric = self.quadrics[b];
        self.quadrics[a].add(&quadric);
        self.vertices[a] = place;
        self.moved[a] += 1;
        self.moved[b] += 1;
        for v in self.neighbours(a) {
            self.consider([a, v]);
        }
    }

    /// Vertices that are left, and faces.
    fn parts(&self) -> (Vec<Vec3>, Vec<[usize; 3]>) {
        let mut number = HashMap::new();
        let mut vertices = Vec::new();
        let faces = self.faces.iter().flatten().map(|face| {
            face.map(|v| {
                *number.entry(v).or_insert_with(|| {
                    vertices.push(self.vertices[v] * self.size + self.middle);
                    vertices.len() - 1
                })
            })
        });
        let faces = faces.collect();
        (vertices, faces)
    }
}
