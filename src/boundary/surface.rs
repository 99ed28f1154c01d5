//! The closed triangle surface that a discretisation starts from.

use crate::adjoint::kernel;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::{Error, Result};
use std::collections::HashMap;

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
}

/// Edge of an equilateral triangle of this area.
pub(crate) fn equilateral_edge(area: f64) -> f64 {
    (4.0 * area / 3.0_f64.sqrt()).sqrt()
}

/// Checked mesh with what the depth rule needs.
pub(crate) struct Surface<'a> {
    pub name: &'a str,
    pub vertices: &'a [Vec3],
    pub triangles: &'a [[usize; 3]],
    pub faces: Faces,
    /// Angle-weighted unit normals at the vertices.
    pub vertex_normals: Vec<Vec3>,
    /// Mean size of the faces that meet at a vertex: the edge of an equilateral triangle of
    /// their area, m.
    pub vertex_edge: Vec<f64>,
}

impl<'a> Surface<'a> {
    pub fn new(name: &'a str, vertices: &'a [Vec3], triangles: &'a [[usize; 3]]) -> Result<Self> {
        let bad = |problem: String, location: String, remedy: &str| Error::Mesh {
            name: name.to_string(),
            problem,
            location,
            remedy: remedy.to_string(),
        };
        if triangles.len() < 4 || vertices.len() < 4 {
            return Err(bad(
                format!("{} vertices and {} faces", vertices.len(), triangles.len()),
                "whole mesh".into(),
                "a closed surface has at least 4 of each",
            ));
        }
        if let Some(i) = vertices
            .iter()
            .position(|v| !v.iter().all(|x| x.is_finite()))
        {
            return Err(bad(
                "a coordinate that is not finite".into(),
                format!("vertex {i} at {:?}", vertices[i].as_slice()),
                "mend the file that it came from",
            ));
        }
        let low = vertices.iter().fold(vertices[0], |m, v| m.inf(v));
        let high = vertices.iter().fold(vertices[0], |m, v| m.sup(v));
        let size = (high - low).norm();
        let (mut corners, mut centres) = (Vec::new(), Vec::new());
        let (mut normals, mut areas) = (Vec::new(), Vec::new());
        let mut vertex_normals = vec![Vec3::zeros(); vertices.len()];
        let mut vertex_edge = vec![(0.0, 0usize); vertices.len()];
        let mut edges = Vec::with_capacity(3 * triangles.len());
        for (i, t) in triangles.iter().enumerate() {
            if let Some(k) = t.iter().find(|k| **k >= vertices.len()) {
                return Err(bad(
                    format!("vertex index {k} of {}", vertices.len()),
                    format!("face {i}"),
                    "indices count from 0 to the number of vertices less 1",
                ));
            }
            let c = t.map(|k| vertices[k]);
            let cross = (c[1] - c[0]).cross(&(c[2] - c[0]));
            let longest = (0..3)
                .map(|k| (c[(k + 1) % 3] - c[k]).norm())
                .fold(0.0, f64::max);
            // Also refuses repeated vertices and a mesh of size zero.
            if cross.norm() <= 1e-12 * longest * longest || longest <= 1e-12 * size {
                return Err(bad(
                    format!("a face of area {:.3e} m²", 0.5 * cross.norm()),
                    format!("face {i} at {:?}", c[0].as_slice()),
                    "remove or merge degenerate faces",
                ));
            }
            for k in 0..3 {
                let (e, f) = (c[(k + 1) % 3] - c[k], c[(k + 2) % 3] - c[k]);
                vertex_normals[t[k]] += cross.normalize() * e.angle(&f);
                vertex_edge[t[k]].0 += equilateral_edge(0.5 * cross.norm());
                vertex_edge[t[k]].1 += 1;
                edges.push((t[k], t[(k + 1) % 3]));
            }
            corners.push(c);
            centres.push((c[0] + c[1] + c[2]) / 3.0);
            normals.push(cross.normalize());
            areas.push(0.5 * cross.norm());
        }
        // Closed and consistently oriented: each directed edge once, and its reverse once.
        edges.sort_unstable();
        let twice = edges.windows(2).find(|w| w[0] == w[1]).map(|w| w[0]);
        let open = edges
            .iter()
            .find(|(a, b)| edges.binary_search(&(*b, *a)).is_err());
        if let Some((a, b)) = twice.or(open.copied()) {
            return Err(bad(
                "not a closed, consistently oriented surface".into(),
                format!("edge {a}–{b} at {:?}", vertices[a].as_slice()),
                "each edge must belong to two faces that run along it in opposite senses",
            ));
        }
        for (i, n) in vertex_normals.iter_mut().enumerate() {
            if vertex_edge[i].1 == 0 {
                return Err(bad(
                    "a vertex without faces".into(),
                    format!("vertex {i} at {:?}", vertices[i].as_slice()),
                    "remove unused vertices",
                ));
            }
            *n = n.try_normalize(1e-9).ok_or_else(|| {
                bad(
                    "a vertex whose faces fold back on each other".into(),
                    format!("vertex {i} at {:?}", vertices[i].as_slice()),
                    "mend the surface there",
                )
            })?;
        }
        let faces = Faces {
            corners,
            centres,
            normals,
            areas,
        };
        let volume = faces.volume();
        if volume.is_nan() || volume <= 1e-12 * size.powi(3) {
            return Err(bad(
                format!("volume {volume:.3e} m³"),
                "whole mesh".into(),
                "normals must point into the fluid; flip the faces",
            ));
        }
        Ok(Self {
            name,
            vertices,
            triangles,
            faces,
            vertex_normals,
            vertex_edge: vertex_edge.iter().map(|(s, n)| s / *n as f64).collect(),
        })
    }

    /// Faces around each vertex, grouped into the smooth patches that meet there: faces that share
    /// an edge at the vertex and turn by less than `sharp` (rad) across it belong together.
    pub fn patches(&self, sharp: f64) -> Vec<Vec<Vec<usize>>> {
        let mut around = vec![Vec::new(); self.vertices.len()];
        for (i, t) in self.triangles.iter().enumerate() {
            for k in t {
                around[*k].push(i);
            }
        }
        let smooth = |v: usize, a: usize, b: usize| {
            let shared = |k: &&usize| **k != v && self.triangles[b].contains(*k);
            self.triangles[a].iter().any(|k| shared(&k))
                && self.faces.normals[a].dot(&self.faces.normals[b]) > sharp.cos()
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

    /// Length of the edges across which the surface turns by more than `sharp` (rad), m.
    pub fn sharp_edges(&self, sharp: f64) -> f64 {
        let mut sides = HashMap::with_capacity(3 * self.triangles.len());
        for (i, t) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                sides.insert([t[k], t[(k + 1) % 3]], i);
            }
        }
        let normals = &self.faces.normals;
        let length = |[a, b]: [usize; 2], face: usize| {
            let other = sides.get(&[b, a]).copied().unwrap_or(face);
            match normals[face].dot(&normals[other]) < sharp.cos() {
                true => (self.vertices[a] - self.vertices[b]).norm(),
                false => 0.0,
            }
        };
        // In the order of the faces, so that the sum is always the same; each edge from both sides.
        let around = |(i, t): (usize, &[usize; 3])| -> f64 {
            (0..3).map(|k| length([t[k], t[(k + 1) % 3]], i)).sum()
        };
        0.5 * self.triangles.iter().enumerate().map(around).sum::<f64>()
    }

    /// How often the surface winds around `x`: 1 inside, 0 outside.
    pub fn winding(&self, x: &Vec3) -> f64 {
        let solid_angle = |c: &[Vec3; 3]| kernel::flux(c, 1.0, x);
        let total: f64 = self.faces.corners.iter().map(solid_angle).sum();
        total / (4.0 * std::f64::consts::PI)
    }

    /// Whether `x` is strictly inside. A point on an edge or vertex is not.
    pub fn contains(&self, x: &Vec3) -> bool {
        (self.winding(x) - 1.0).abs() < 1e-6
    }

    /// Radius of the largest ball inside the body that touches the surface at `x` with outward normal
    /// `n`, m: min over the surface's points q of |x − q|² / 2n·(x − q), taken over vertices, face
    /// centres and the point opposite, `thickness` away (Ma, Bae & Choi 2012, without iteration).
    pub fn ball(&self, x: &Vec3, n: &Vec3, thickness: f64) -> f64 {
        let points = self.vertices.iter().chain(&self.faces.centres);
        points.fold(0.5 * thickness, |radius, q| {
            let d = x - q;
            let height = d.dot(n);
            // The point itself, and points level with it up to round-off, bound nothing.
            if height > 1e-12 * d.norm() {
                radius.min(d.norm_squared() / (2.0 * height))
            } else {
                radius
            }
        })
    }

    /// Distance along `direction` from `x` to the first face that doesn't contain vertex `vertex`
    /// and isn't face `face` (Möller & Trumbore 1997), m.
    pub fn ray(&self, x: &Vec3, direction: &Vec3, vertex: usize, face: usize) -> Option<f64> {
        let mut nearest: Option<f64> = None;
        for (i, t) in self.triangles.iter().enumerate() {
            if i == face || t.contains(&vertex) {
                continue;
            }
            let [a, b, c] = &self.faces.corners[i];
            let (e1, e2) = (b - a, c - a);
            let p = direction.cross(&e2);
            let det = e1.dot(&p);
            // A face seen edge on isn't hit.
            if det.abs() <= 1e-12 * e1.norm() * e2.norm() {
                continue;
            }
            let s = x - a;
            let u = s.dot(&p) / det;
            let q = s.cross(&e1);
            let v = direction.dot(&q) / det;
            let t = e2.dot(&q) / det;
            let slack = 1e-9;
            if u >= -slack && v >= -slack && u + v <= 1.0 + slack && t > 0.0 {
                nearest = Some(nearest.map_or(t, |n| n.min(t)));
            }
        }
        nearest
    }
}

/// max |M − Mᵀ|_ij / √(M_ii M_jj), by [`scaled`].
pub(crate) fn asymmetry(m: &Mat6, faces: &Faces) -> f64 {
    scaled(&(m - m.transpose()), m, faces)
}

/// max |D_ij| / √(M_ii M_jj). A diagonal entry under a hundredth of the displaced fluid's own
/// inertia (a sphere's rotation) counts as that hundredth.
pub(crate) fn scaled(difference: &Mat6, m: &Mat6, faces: &Faces) -> f64 {
    let area: f64 = faces.areas.iter().sum();
    let pairs = || faces.centres.iter().zip(&faces.areas);
    let middle = pairs().map(|(c, a)| c * *a).sum::<Vec3>() / area;
    let spread = pairs()
        .map(|(c, a)| (c - middle).norm_squared() * a)
        .sum::<f64>()
        / area;
    let volume = faces.volume();
    let diagonal = |i: usize| {
        let displaced = if i < 3 { volume } else { volume * spread };
        m[(i, i)].max(0.01 * displaced)
    };
    let mut worst = 0.0_f64;
    for i in 0..6 {
        for j in 0..6 {
            let scale = (diagonal(i) * diagonal(j)).sqrt();
            worst = worst.max(difference[(i, j)].abs() / scale);
        }
    }
    worst
}
