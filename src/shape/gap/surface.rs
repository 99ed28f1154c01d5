//! One surface, ready to be asked: its faces in a tree of boxes, and its normals.

use super::super::mesh::TriMesh;
use super::triangle::{Feature, Triangle};
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Pose, Vec3};
use std::collections::HashMap;

/// Faces in a leaf, at most.
const LEAF: usize = 2;

/// A box of the tree, body frame. Its first child follows it in the list.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub center: Vec3,
    pub half: Vec3,
    /// Its faces, in the order of the tree.
    pub faces: std::ops::Range<usize>,
    /// Its second child; none in a leaf.
    pub second: Option<usize>,
}

impl Node {
    /// Square of the distance of a point to the box.
    #[inline]
    fn distance_squared(&self, p: &Vec3) -> f64 {
        let out = (p - self.center).abs() - self.half;
        out.map(|x| x.max(0.0)).norm_squared()
    }
}

/// A surface in its body frame.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub nodes: Vec<Node>,
    /// In the order of the tree, as are `corners` and `edge_normals`.
    pub triangles: Vec<Triangle>,
    pub corners: Vec<[usize; 3]>,
    pub vertices: Vec<Vec3>,
    /// Sum of the unit normals at each edge of a face, from its corner k to the next.
    edge_normals: Vec<[Vec3; 3]>,
    /// Normals weighted with the angles at each vertex.
    vertex_normals: Vec<Vec3>,
    /// Mean edge length around each vertex, m.
    edge_at_vertex: Vec<f64>,
    /// One vertex of every connected piece.
    pub seeds: Vec<usize>,
    /// Centre and radius of a ball around all.
    pub center: Vec3,
    pub radius: f64,
    /// Largest distance of a vertex from the body's origin.
    pub reach: f64,
}

impl Surface {
    pub fn new(mesh: &TriMesh) -> Result<Self> {
        let refuse = |problem: String, location: String, remedy: &str| Error::Mesh {
            name: mesh.name().into(),
            problem,
            location,
            remedy: remedy.into(),
        };
        if mesh.faces().is_empty() {
            return Err(refuse(
                "no faces".into(),
                "whole mesh".into(),
                "give a closed surface",
            ));
        }
        let vertices = mesh.vertices().to_vec();
        // Finite, and far enough from the limits for products of four lengths.
        let usable = |x: &Vec3| x.iter().all(|c| c.abs() <= 1e60);
        if let Some((v, x)) = vertices.iter().enumerate().find(|(_, x)| !usable(x)) {
            return Err(refuse(
                "vertex out of range".into(),
                format!("vertex {v} at {:?} m, counted from 0", x.as_slice()),
                "give finite coordinates in metres",
            ));
        }
        let all: Vec<Triangle> = (0..mesh.faces().len())
            .map(|f| Triangle::new(mesh.corners(f)))
            .collect();
        let (edge_normals, vertex_normals) = normals(mesh, &all);
        let centroids: Vec<Vec3> = (0..all.len()).map(|f| mesh.centroid(f)).collect();
        let mut order: Vec<usize> = (0..all.len()).collect();
        let mut nodes = Vec::with_capacity(2 * all.len());
        grow(&mut nodes, &mut order, 0, &centroids, &all);
        let center = nodes[0].center;
        // Only vertices that faces use bound the surface.
        let used = || all.iter().flat_map(|t| t.corners.iter());
        Ok(Self {
            triangles: order.iter().map(|&f| all[f]).collect(),
            corners: order.iter().map(|&f| mesh.faces()[f]).collect(),
            edge_normals: order.iter().map(|&f| edge_normals[f]).collect(),
            vertex_normals,
            edge_at_vertex: edge_lengths(mesh),
            seeds: seeds(mesh),
            radius: used().map(|x| (x - center).norm()).fold(0.0, f64::max),
            reach: used().map(|x| x.norm()).fold(0.0, f64::max),
            nodes,
            vertices,
            center,
        })
    }

    /// Mean edge length around a face, m.
    pub fn edge_at_face(&self, face: usize) -> f64 {
        self.corners[face]
            .iter()
            .map(|&v| self.edge_at_vertex[v])
            .sum::<f64>()
            / 3.0
    }

    /// Centroid of a face.
    pub fn centroid(&self, face: usize) -> Vec3 {
        let [a, b, c] = self.triangles[face].corners;
        a + ((b - a) + (c - a)) / 3.0
    }

    /// Whether a point can be inside at all.
    pub fn boxed(&self, p: &Vec3) -> bool {
        self.nodes[0].distance_squared(p) <= 0.0
    }

    /// Depth of a point inside the surface if it is above `floor` ≥ 0.
    pub fn depth_above(&self, p: &Vec3, floor: f64) -> Option<f64> {
        if !self.boxed(p) {
            return None;
        }
        let stop = floor * floor;
        let mut best = Nearest::none(p);
        self.nearest(0, p, stop, &mut best);
        (best.square > stop && best.square.is_finite() && self.inside(p, &best))
            .then(|| best.square.sqrt())
    }

    /// Closest point to `p`; given up once it is nearer than the root of `stop`.
    fn nearest(&self, node: usize, p: &Vec3, stop: f64, best: &mut Nearest) {
        let Node { faces, second, .. } = &self.nodes[node];
        let Some(second) = *second else {
            for face in faces.clone() {
                let (point, feature) = self.triangles[face].closest(p);
                let square = (p - point).norm_squared();
                if square < best.square {
                    *best = Nearest {
                        square,
                        point,
                        face,
                        feature,
                    };
                }
            }
            return;
        };
        let mut children = [node + 1, second].map(|n| (self.nodes[n].distance_squared(p), n));
        if children[1].0 < children[0].0 {
            children.swap(0, 1);
        }
        for (bound, child) in children {
            if bound < best.square && best.square > stop {
                self.nearest(child, p, stop, best);
            }
        }
    }

    /// Whether a point is inside, from the normal at the closest point: of the face, or summed
    /// over the faces of the edge or corner that the closest point lies on.
    ///
    /// # References
    /// Bærentzen and Aanæs 2005, Signed distance computation using the angle weighted
    /// pseudonormal, IEEE Trans. Vis. Comput. Graphics 11(3).
    fn inside(&self, p: &Vec3, nearest: &Nearest) -> bool {
        let normal = match nearest.feature {
            Feature::Face => self.triangles[nearest.face].normal,
            Feature::Edge(k) => self.edge_normals[nearest.face][k],
            Feature::Corner(k) => self.vertex_normals[self.corners[nearest.face][k]],
        };
        let away = p - nearest.point;
        let side = away.dot(&normal);
        if side.abs() > 1e-6 * away.norm() * normal.norm() {
            return side < 0.0;
        }
        // Undecided: the solid angle of the whole surface decides.
        self.turns(p) > 0.5
    }

    /// How often the surface winds around a point.
    fn turns(&self, p: &Vec3) -> f64 {
        let half: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.corners.map(|x| x - p);
                let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
                let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
                a.dot(&b.cross(&c)).atan2(below)
            })
            .sum();
        half / std::f64::consts::TAU
    }

    /// Midway between a face and what lies opposite inside the surface.
    pub fn middle(&self, face: usize) -> Option<Vec3> {
        let from = self.centroid(face);
        let inward = -self.triangles[face].normal;
        let to = from + inward * (2.5 * self.radius);
        // Steps over what touches the face itself.
        let least = 1e-9;
        let mut first = 1.0;
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let n = &self.nodes[node];
            if !segment_meets(&from, &((to - from) * first), n) {
                continue;
            }
            if let Some(second) = n.second {
                stack.extend([second, node + 1]);
                continue;
            }
            for f in n.faces.clone().filter(|&f| f != face) {
                match self.triangles[f].pierced(&from, &to) {
                    Some(s) if s > least && s < first => first = s,
                    _ => {}
                }
            }
        }
        (first < 1.0).then(|| from + (to - from) * (0.5 * first))
    }

    /// Closest point to `p` and its face.
    pub fn closest(&self, p: &Vec3) -> (Vec3, usize) {
        let mut best = Nearest::none(p);
        self.nearest(0, p, 0.0, &mut best);
        (best.point, best.face)
    }

    /// Distance of a point, negative inside, and the closest face; none if the point isn't finite.
    pub fn signed(&self, p: &Vec3) -> Option<(f64, usize)> {
        let mut best = Nearest::none(p);
        self.nearest(0, p, 0.0, &mut best);
        let distance = best.square.sqrt();
        let inside = distance > 0.0 && self.inside(p, &best);
        let signed = if inside { -distance } else { distance };
        signed.is_finite().then_some((signed, best.face))
    }

    /// Smallest height of a vertex above the plane with unit normal `normal` through `point`,
    /// world frame, and the mean edge length there.
    pub fn height(&self, pose: &Pose, point: &Vec3, normal: &Vec3) -> (f64, f64) {
        let (lowest, vertex) = self.lowest(&pose.rotation.tr_mul(normal));
        let shift = (pose.translation - point).dot(normal);
        (lowest + shift, self.edge_at_vertex[vertex])
    }

    /// The vertex least far along a direction, body frame, and how far it is.
    pub fn lowest(&self, along: &Vec3) -> (f64, usize) {
        let size = along.abs();
        let mut best = (f64::INFINITY, self.corners[0][0]);
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let n = &self.nodes[node];
            if n.center.dot(along) - n.half.dot(&size) >= best.0 {
                continue;
            }
            if let Some(second) = n.second {
                let (near, far) = (node + 1, second);
                if self.nodes[near].center.dot(along) <= self.nodes[far].center.dot(along) {
                    stack.extend([far, near]);
                } else {
                    stack.extend([near, far]);
                }
                continue;
            }
            for f in n.faces.clone() {
                for (k, x) in self.triangles[f].corners.iter().enumerate() {
                    let h = x.dot(along);
                    if h < best.0 {
                        best = (h, self.corners[f][k]);
                    }
                }
            }
        }
        best
    }
}

/// The closest point found so far.
struct Nearest {
    square: f64,
    point: Vec3,
    face: usize,
    feature: Feature,
}

impl Nearest {
    fn none(p: &Vec3) -> Self {
        Self {
            square: f64::INFINITY,
            point: *p,
            face: 0,
            feature: Feature::Face,
        }
    }
}

/// Whether the segment from `from` along `along` meets a box.
fn segment_meets(from: &Vec3, along: &Vec3, node: &Node) -> bool {
    let middle = from + along * 0.5 - node.center;
    let half = along.abs() * 0.5;
    let apart = (0..3).any(|i| middle[i].abs() > half[i] + node.half[i]);
    if apart {
        return false;
    }
    (0..3).all(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let offset = (middle[j] * along[k] - middle[k] * along[j]).abs() * 0.5;
        let room = half[j] * node.half[k] + half[k] * node.half[j];
        offset <= room * (1.0 + 1e-9)
    })
}

/// Builds the tree over `order`, whose first element is number `start`, and returns its root.
fn grow(
    nodes: &mut Vec<Node>,
    order: &mut [usize],
    start: usize,
    centroids: &[Vec3],
    triangles: &[Triangle],
) -> usize {
    let [low, high] =
        super::super::mesh::bounds(order.iter().flat_map(|&f| triangles[f].corners.iter()));
    let root = nodes.len();
    let center = low + (high - low) * 0.5;
    nodes.push(Node {
        center,
        // No corner may stick out by rounding.
        half: (high - center).sup(&(center - low)),
        faces: start..start + order.len(),
        second: None,
    });
    if order.len() > LEAF {
        let [low, high] = super::super::mesh::bounds(order.iter().map(|&f| &centroids[f]));
        let axis = (high - low).imax();
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |&f, &g| {
            centroids[f][axis]
                .total_cmp(&centroids[g][axis])
                .then(f.cmp(&g))
        });
        let (left, right) = order.split_at_mut(half);
        grow(nodes, left, start, centroids, triangles);
        let second = grow(nodes, right, start + half, centroids, triangles);
        nodes[root].second = Some(second);
    }
    root
}

/// Normals at edges (of each face) and at vertices.
fn normals(mesh: &TriMesh, triangles: &[Triangle]) -> (Vec<[Vec3; 3]>, Vec<Vec3>) {
    let key = |a: usize, b: usize| (a.min(b), a.max(b));
    let mut at_edge: HashMap<(usize, usize), Vec3> = HashMap::new();
    let mut at_vertex = vec![Vec3::zeros(); mesh.vertices().len()];
    for (face, t) in mesh.faces().iter().zip(triangles) {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            *at_edge.entry(key(a, b)).or_insert_with(Vec3::zeros) += t.normal;
            let x = &t.corners;
            let (to, back) = (x[(k + 1) % 3] - x[k], x[(k + 2) % 3] - x[k]);
            let angle = to.cross(&back).norm().atan2(to.dot(&back));
            at_vertex[a] += t.normal * angle;
        }
    }
    let edges = mesh
        .faces()
        .iter()
        .map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(|(a, b)| at_edge[&key(a, b)]))
        .collect();
    (edges, at_vertex)
}

/// Mean edge length of the faces around each vertex.
fn edge_lengths(mesh: &TriMesh) -> Vec<f64> {
    let mut sum = vec![(0.0, 0.0); mesh.vertices().len()];
    for (f, face) in mesh.faces().iter().enumerate() {
        let [a, b, c] = mesh.corners(f);
        let mean = ((b - a).norm() + (c - b).norm() + (a - c).norm()) / 3.0;
        for &v in face {
            sum[v].0 += mean;
            sum[v].1 += 1.0;
        }
    }
    sum.iter()
        .map(|&(total, count): &(f64, f64)| total / count.max(1.0))
        .collect()
}

/// One vertex of every connected piece.
fn seeds(mesh: &TriMesh) -> Vec<usize> {
    let mut parent: Vec<usize> = (0..mesh.vertices().len()).collect();
    fn root(parent: &mut [usize], mut v: usize) -> usize {
        while parent[v] != v {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        v
    }
    for face in mesh.faces() {
        for &v in &face[1..] {
            let (a, b) = (root(&mut parent, face[0]), root(&mut parent, v));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut found: Vec<usize> = mesh
        .faces()
        .iter()
        .map(|face| root(&mut parent, face[0]))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}
