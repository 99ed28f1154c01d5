//! The side of a bearing that its pressure is solved on.

use crate::adjoint::lie::Vec3;
use crate::coupling::film::TOGETHER;
use crate::geometry::{Casing, Cluster, Solid, TriMesh, bounds, clusters};

/// Cosine between normals of a shape and of its mesh from which on they are the same one's.
const ROUND: f64 = 0.9;

/// A body's surface as bearings see it, in the body's frame.
#[derive(Clone, Debug)]
pub struct BearingSurface {
    /// On the exact shape where there is one.
    pub vertices: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    pub faces: Vec<[usize; 3]>,
    /// The exact shape.
    pub solid: Option<Solid>,
    pub clusters: Vec<Cluster>,
    /// A box around it, and around the exact shape.
    pub(crate) casing: Casing,
    /// Diameter of the ball around it, m.
    pub size: f64,
    /// The longest edge, m.
    pub longest: f64,
}

impl BearingSurface {
    /// Of a mesh, and of the shape by formula that it stands for.
    pub fn new(mesh: &TriMesh, solid: Option<&Solid>) -> Self {
        let on = |x: &Vec3| solid.map_or(*x, |solid| landed(solid, x));
        let vertices: Vec<Vec3> = mesh.vertices().iter().map(on).collect();
        let edges = mesh.faces().iter().flat_map(|&[a, b, c]| {
            [(a, b), (b, c), (c, a)].map(|(a, b)| (vertices[a] - vertices[b]).norm())
        });
        let normals = mesh.vertex_normals();
        let own = Casing::new(bounds(vertices.iter()));
        let exact = solid.map(|solid| Casing::new(solid.bounds()));
        let upright = |(x, n): (&Vec3, &Vec3)| solid.map_or(*n, |solid| normal(solid, x, n));
        Self {
            longest: edges.fold(0.0, f64::max),
            normals: vertices.iter().zip(&normals).map(upright).collect(),
            faces: mesh.faces().to_vec(),
            solid: solid.cloned(),
            casing: exact.map_or(own, |exact| own.joined(exact)),
            clusters: clusters(&vertices, TOGETHER),
            size: 2.0 * mesh.bounding_ball().radius,
            vertices,
        }
    }

    /// The point of the surface halfway between two, and its normal.
    pub fn halfway(&self, [a, b]: [&Vec3; 2], normals: [&Vec3; 2]) -> (Vec3, Vec3) {
        let middle = 0.5 * (a + b);
        let mean = (normals[0] + normals[1]).try_normalize(0.0);
        let mean = mean.unwrap_or(*normals[0]);
        match &self.solid {
            Some(solid) => {
                let at = landed(solid, &middle);
                (at, normal(solid, &at, &mean))
            }
            None => (middle, mean),
        }
    }
}

/// The normal of a shape at a point of its surface, where it is round there: about that of a mesh.
fn normal(solid: &Solid, x: &Vec3, about: &Vec3) -> Vec3 {
    let gradient = solid.field(x).gradient;
    if gradient.dot(about) > ROUND {
        gradient
    } else {
        *about
    }
}

/// A point near a shape, led to its surface.
fn landed(solid: &Solid, x: &Vec3) -> Vec3 {
    let field = solid.field(x);
    let at = x - field.distance * field.gradient;
    if at.iter().all(|x| x.is_finite()) {
        at
    } else {
        *x
    }
}
