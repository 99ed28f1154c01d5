//! One mesh, ready to be asked for closest points: its faces in a tree of boxes, and its normals.

use super::boxes::{Node, tree};
use super::casing::Casing;
use super::mesh::TriMesh;
use super::points::{Ball, winding_number};
use super::topology;
use super::triangle::{Feature, Triangle};
use super::wall::HalfSpace;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// A mesh in its body frame.
#[derive(Clone, Debug)]
pub(super) struct MeshTree {
    pub nodes: Vec<Node>,
    /// In the order of the tree, as are `corners` and `edge_normals`.
    pub triangles: Vec<Triangle>,
    pub corners: Vec<[usize; 3]>,
    /// Numbers of the faces in the mesh.
    pub numbers: Vec<usize>,
    pub vertices: Vec<Vec3>,
    /// Sum of the unit normals at each edge of a face, from its corner k to the next.
    edge_normals: Vec<[Vec3; 3]>,
    /// Unit normals at each vertex.
    vertex_normals: Vec<Vec3>,
    /// Mean edge length around each vertex, m.
    edge_at_vertex: Vec<f64>,
    /// A vertex of each piece.
    pub pieces: Vec<usize>,
    /// A ball around all.
    pub ball: Ball,
    /// Largest distance of a vertex from the body's origin.
    pub reach: f64,
}

impl MeshTree {
    pub fn new(mesh: &TriMesh) -> Self {
        let all: Vec<Triangle> = (0..mesh.faces().len())
            .map(|f| Triangle::new(mesh.corners(f)))
            .collect();
        let edge_normals = edge_normals(mesh, &all);
        let (nodes, order) = tree(&all, |f| mesh.centroid(f));
        Self {
            triangles: order.iter().map(|&f| all[f]).collect(),
            corners: order.iter().map(|&f| mesh.faces()[f]).collect(),
            edge_normals: order.iter().map(|&f| edge_normals[f]).collect(),
            vertex_normals: mesh.vertex_normals(),
            edge_at_vertex: edge_lengths(mesh),
            pieces: pieces(mesh),
            ball: mesh.bounding_ball(),
            reach: mesh.vertices().iter().map(|x| x.norm()).fold(0.0, f64::max),
            nodes,
            numbers: order,
            vertices: mesh.vertices().to_vec(),
        }
    }

    /// Mean edge length around a face, m.
    pub fn edge_at_face(&self, face: usize) -> f64 {
        let edges = self.corners[face].map(|v| self.edge_at_vertex[v]);
        edges.iter().sum::<f64>() / 3.0
    }

    /// No mean edge length around a face is more than this, m.
    pub fn longest_edge(&self) -> f64 {
        let longest = self.edge_at_vertex.iter().copied().fold(0.0, f64::max);
        // With room for the rounding of a mean.
        longest * (1.0 + 1e-12)
    }

    /// Area of a face, m².
    pub fn area(&self, face: usize) -> f64 {
        self.area_vector(face).norm()
    }

    /// That along its outward normal, m².
    pub fn area_vector(&self, face: usize) -> Vec3 {
        let [a, b, c] = self.triangles[face].corners;
        0.5 * (b - a).cross(&(c - a))
    }

    /// Mean edge length around the face closest to a point, m.
    pub fn edge_near(&self, p: &Vec3) -> f64 {
        self.edge_at_face(self.nearest(p, 0.0).face)
    }

    /// Centroid of a face.
    pub fn centroid(&self, face: usize) -> Vec3 {
        let [a, b, c] = self.triangles[face].corners;
        a + ((b - a) + (c - a)) / 3.0
    }

    /// Depth of a point inside the surface if it is above `floor` ≥ 0.
    pub fn depth_above(&self, p: &Vec3, floor: f64) -> Option<f64> {
        if !self.in_box(p) {
            return None;
        }
        let stop = floor * floor;
        let best = self.nearest(p, stop);
        (best.square > stop && best.square.is_finite() && self.inside(p, &best))
            .then(|| best.square.sqrt())
    }

    /// A box around the mesh.
    pub fn casing(&self) -> Casing {
        let Node { center, half, .. } = &self.nodes[0];
        Casing::new([center - half, center + half])
    }

    /// Whether a ball may reach into the box around the mesh; what isn't a number may.
    pub fn meets_box(&self, center: &Vec3, radius: f64) -> bool {
        let out = self.nodes[0].distance_squared(center);
        !(out > radius * radius * (1.0 + 1e-12) && center.iter().all(|x| x.is_finite()))
    }

    /// Whether a point lies in the box around the mesh.
    pub fn in_box(&self, p: &Vec3) -> bool {
        self.nodes[0].distance_squared(p) <= 0.0
    }

    /// Closest point to `p`; given up once it is nearer than the root of `stop`.
    pub fn nearest(&self, p: &Vec3, stop: f64) -> Nearest {
        let mut best = Nearest {
            square: f64::INFINITY,
            point: *p,
            face: 0,
            feature: Feature::Face,
        };
        self.descend(0, p, stop, &mut best);
        best
    }

    fn descend(&self, node: usize, p: &Vec3, stop: f64, best: &mut Nearest) {
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
                self.descend(child, p, stop, best);
            }
        }
    }

    /// Whether a point is inside, from the normal at the closest point: of the face, or summed
    /// over the faces of the edge or corner that the closest point lies on.
    ///
    /// # References
    /// Bærentzen and Aanæs 2005, Signed distance computation using the angle weighted
    /// pseudonormal, IEEE Trans. Vis. Comput. Graphics 11(3).
    pub fn inside(&self, p: &Vec3, nearest: &Nearest) -> bool {
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
        let corners = self.triangles.iter().map(|t| &t.corners);
        winding_number(corners, p) > 0.5
    }

    /// Midway between a face and what lies opposite inside the surface.
    pub fn middle(&self, face: usize) -> Option<Vec3> {
        let from = self.centroid(face);
        let inward = -self.triangles[face].normal;
        let to = from + inward * (2.5 * self.ball.radius);
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
        let best = self.nearest(p, 0.0);
        (best.point, best.face)
    }

    /// Distance of a point, negative inside, and the closest face; none if the point isn't finite.
    pub fn signed(&self, p: &Vec3) -> Option<(f64, usize)> {
        let best = self.nearest(p, 0.0);
        let distance = best.square.sqrt();
        let inside = distance > 0.0 && self.inside(p, &best);
        let signed = if inside { -distance } else { distance };
        signed.is_finite().then_some((signed, best.face))
    }

    /// Smallest height of a vertex in a half space (world frame), and the mean edge length there.
    pub fn height(&self, pose: &Pose, wall: &HalfSpace) -> (f64, f64) {
        let (lowest, vertex) = self.lowest(&pose.rotation.tr_mul(&wall.normal));
        (
            lowest + wall.height(&pose.translation),
            self.edge_at_vertex[vertex],
        )
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
                let (first, at) = (node + 1, |n: usize| self.nodes[n].center.dot(along));
                let near = at(first) <= at(second);
                stack.extend(if near {
                    [second, first]
                } else {
                    [first, second]
                });
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
pub(super) struct Nearest {
    /// Square of its distance, m².
    pub square: f64,
    pub point: Vec3,
    /// Its face, in the order of the tree, and where in it the point lies.
    pub face: usize,
    pub feature: Feature,
}

/// Whether the segment from `from` along `along` meets a box.
fn segment_meets(from: &Vec3, along: &Vec3, node: &Node) -> bool {
    let middle = from + along * 0.5 - node.center;
    let half = along.abs() * 0.5;
    let apart = (0..3).any(|i| middle[i].abs() > half[i] + node.half[i]);
    !apart
        && (0..3).all(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let offset = (middle[j] * along[k] - middle[k] * along[j]).abs() * 0.5;
            let room = half[j] * node.half[k] + half[k] * node.half[j];
            offset <= room * (1.0 + 1e-9)
        })
}

/// The smallest number of a vertex of each piece.
fn pieces(mesh: &TriMesh) -> Vec<usize> {
    let edges = topology::edges(mesh.faces().iter().copied().enumerate());
    let found = topology::components(mesh.faces().len(), 0..mesh.faces().len(), &edges);
    let least = |f: &usize| mesh.faces()[*f].into_iter().min();
    let least = |piece: &topology::Component| piece.faces.iter().filter_map(least).min();
    found.iter().filter_map(least).collect()
}

/// Of each face the sum of the unit normals at each of its edges.
fn edge_normals(mesh: &TriMesh, triangles: &[Triangle]) -> Vec<[Vec3; 3]> {
    let mut out = vec![[Vec3::zeros(); 3]; triangles.len()];
    for edge in mesh.edges() {
        let [f, g] = edge.faces;
        let [a, b] = edge.vertices;
        let sum = triangles[f].normal + triangles[g].normal;
        for (face, from) in [(f, a), (g, b)] {
            let start = mesh.faces()[face].iter().position(|&v| v == from);
            // Each of the two faces runs through the edge from this vertex.
            out[face][start.unwrap_or(0)] = sum;
        }
    }
    out
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
