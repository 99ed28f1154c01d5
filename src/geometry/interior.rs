//! What lies inside a closed mesh: containment, inner tangent balls, and how thick the body is.
//!
//! Source points of the boundary methods come from these queries, and where those are decides the last digits of
//! everything after, so that a query that finds another face or another rounding would be noticed.
//!
//! # By the library and by our own code
//! Containment is that of `parry3d-f64` (the sign by the pseudonormal of the nearest feature), which agrees with the
//! winding number at every point tested that lies 10⁻⁹ of the body's size or farther from its surface, above faces,
//! edges and vertices of boxes, plates of 10⁻² and 10⁻⁴ of their width, a wedge and a ball, and is logarithmic in the
//! faces where the winding number is linear. A point nearer than [`SURFACE`] counts as on the surface.
//!
//! Rays are our own. Where both find a face the distances agree to 10⁻¹² of the thickness, but the library's triangles
//! have no rim: of 2794 rays from the vertices and face centres of the same bodies against the normal it misses 22,
//! all of them towards an edge or a vertex of the far side, as is the rule on symmetric meshes. A ray that is missed
//! would move a source to another depth. Gaps are our own too (see [`super::gap`]): the distances of two meshes are
//! needed to rounding, and their depths, which the library doesn't give.
//!
//! The figures are printed by `cargo test --lib geometry::queries -- --nocapture`.

use super::faces::Faces;
use super::mesh::TriMesh;
use super::points::winding_number;
use hydrograd_adjoint::lie::Vec3;
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{TriMesh as Solid, TriMeshFlags};

/// Distance over the radius of the bounding ball below which a point is on the surface.
const SURFACE: f64 = 1e-12;

/// A mesh with the geometry of its faces and its normals.
pub(crate) struct Interior<'a> {
    pub mesh: &'a TriMesh,
    pub faces: Faces,
    /// Angle-weighted unit normals at the vertices.
    pub vertex_normals: Vec<Vec3>,
    /// The library's mesh. It refuses only meshes without faces, which there are none of.
    solid: Option<Solid>,
    /// Distance below which a point is on the surface, m.
    surface: f64,
}

impl<'a> Interior<'a> {
    pub fn new(mesh: &'a TriMesh) -> Self {
        Self {
            mesh,
            faces: Faces::of(mesh),
            vertex_normals: mesh.vertex_normals(),
            solid: solid(mesh),
            surface: SURFACE * mesh.bounding_ball().radius,
        }
    }

    /// How often the surface winds around `x`: 1 inside, 0 outside.
    pub fn winding(&self, x: &Vec3) -> f64 {
        winding_number(self.faces.corners.iter(), x)
    }

    /// Whether `x` is strictly inside. A point on the surface is not.
    pub fn contains(&self, x: &Vec3) -> bool {
        let x = vector(x);
        self.solid.as_ref().is_some_and(|solid| {
            let nearest = solid.project_local_point(x, false);
            nearest.is_inside && (nearest.point - x).length() > self.surface
        })
    }

    /// Radius of the largest ball inside the body that touches the surface at `x` with outward normal
    /// `n`, m: min over the surface's points q of |x − q|² / 2n·(x − q), taken over vertices, face
    /// centres and the point opposite, `thickness` away (Ma, Bae & Choi 2012, without iteration).
    pub fn tangent_ball(&self, x: &Vec3, n: &Vec3, thickness: f64) -> f64 {
        let points = self.mesh.vertices().iter().chain(&self.faces.centres);
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
        for (i, t) in self.mesh.faces().iter().enumerate() {
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

fn vector(x: &Vec3) -> Vector {
    Vector::new(x.x, x.y, x.z)
}

fn solid(mesh: &TriMesh) -> Option<Solid> {
    let vertices = mesh.vertices().iter().map(vector).collect();
    let faces = mesh.faces().iter().map(|f| f.map(|v| v as u32)).collect();
    Solid::with_flags(vertices, faces, TriMeshFlags::ORIENTED).ok()
}
