//! The side of a film that its potential is solved on.

use crate::adjoint::lie::{Vec3, Vec6, point_wrench};
use crate::geometry::{Casing, Cluster, TriMesh, bounds, clusters};
use crate::solver::elimination_order;
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// Vertices in a [`Cluster`] at most.
pub(crate) const TOGETHER: usize = 8;

/// A body's surface as films see it, in the body's frame: linear elements on its faces.
#[derive(Clone, Debug)]
pub(crate) struct FilmSurface {
    pub vertices: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Share of the vertices in the area, m².
    pub areas: Vec<f64>,
    /// What a unit twist of the body pushes at each vertex: ∫ φ (n, x × n) dA; m², m³.
    pub loads: Vec<Vec6>,
    pub faces: Vec<Element>,
    /// Of the ball of equal volume, m.
    pub size: f64,
    /// Its edges over those of the faces that the body has elsewhere.
    pub finer: f64,
    /// Area over that of the ball of equal volume.
    pub flatness: f64,
    /// A ball around the vertices.
    pub center: Vec3,
    pub radius: f64,
    /// A box around them.
    pub casing: Casing,
    pub clusters: Vec<Cluster>,
    /// The vertices in an order of elimination, of all systems on some of them.
    pub order: Vec<usize>,
}

/// A face.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub corners: [usize; 3],
    /// ∇φ_i · ∇φ_j, 1/m².
    pub slopes: Matrix3<f64>,
    /// ∇φ_i in the columns, 1/m.
    pub gradients: Matrix3<f64>,
    /// Unit normal.
    pub normal: Vec3,
    /// Where a force that is spread as φ_i acts.
    pub arms: [Vec3; 3],
    /// m².
    pub area: f64,
    /// How far the shape that the mesh stands for lies outside the middle of the edge from each corner to the next, m.
    pub bulge: [f64; 3],
}

/// Cosine of the angle between faces up to which a mesh stands for a round surface there.
const ROUND: f64 = 0.8;

impl FilmSurface {
    /// Of a mesh that stands for itself, or for a shape by formula (`round`), which lies outside its edges where it is curved.
    pub fn new(mesh: &TriMesh, round: bool) -> Self {
        let count = mesh.vertices().len();
        let (mut areas, mut loads) = (vec![0.0; count], vec![Vec6::zeros(); count]);
        let mut faces = Vec::with_capacity(mesh.faces().len());
        for (f, corners) in mesh.faces().iter().enumerate() {
            let (points, area) = (mesh.corners(f), mesh.area(f));
            let push = mesh.area_vector(f);
            // Products of linear functions over a triangle: 1/6 on the diagonal, 1/12 beside it.
            let arms = points.map(|x| (points.iter().sum::<Vec3>() + x) / 4.0);
            for (v, at) in corners.iter().zip(&arms) {
                areas[*v] += area / 3.0;
                loads[*v] += point_wrench(at, &(push / 3.0));
            }
            let normal = push / area;
            let slope = |i: usize| normal.cross(&(points[(i + 2) % 3] - points[(i + 1) % 3]));
            let slopes = Matrix3::from_columns(&[0, 1, 2].map(slope)) / (2.0 * area);
            faces.push(Element {
                corners: *corners,
                slopes: slopes.tr_mul(&slopes),
                gradients: slopes,
                normal,
                arms,
                area,
                bulge: [0.0; 3],
            });
        }
        let edges = mesh
            .faces()
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let edges: Vec<_> = edges.collect();
        // Corners of a mesh are among its vertices.
        let order = elimination_order(count, &edges).unwrap_or_else(|| (0..count).collect());
        if round {
            bulge(mesh.vertices(), &mut faces);
        }
        let ball = mesh.bounding_ball();
        let size = (0.75 * mesh.mass_properties().volume / PI).cbrt();
        Self {
            finer: 1.0,
            flatness: mesh.surface_area() / (4.0 * PI * size.powi(2)),
            vertices: mesh.vertices().to_vec(),
            normals: mesh.vertex_normals(),
            areas,
            loads,
            faces,
            size,
            center: ball.center,
            radius: ball.radius,
            casing: Casing::new(bounds(mesh.vertices().iter())),
            clusters: clusters(mesh.vertices(), TOGETHER),
            order,
        }
    }
}

/// Sets how far the shape lies outside the edges: an eighth of the edge times how far the normals at its ends, each the mean of the faces there that are nearly parallel, turn
/// apart along it.
fn bulge(vertices: &[Vec3], faces: &mut [Element]) {
    let mut around = vec![Vec::new(); vertices.len()];
    for face in faces.iter() {
        for v in face.corners {
            around[v].push((face.normal, face.area));
        }
    }
    for face in faces {
        let normals = face.corners.map(|v| {
            let near = (around[v].iter()).filter(|(n, _)| n.dot(&face.normal) > ROUND);
            near.map(|(n, area)| n * *area).sum::<Vec3>().normalize()
        });
        face.bulge = [0, 1, 2].map(|i| {
            let j = (i + 1) % 3;
            let edge = vertices[face.corners[j]] - vertices[face.corners[i]];
            ((normals[j] - normals[i]).dot(&edge) / 8.0).max(0.0)
        });
    }
}
