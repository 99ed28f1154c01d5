//! The closed triangle mesh and the geometry of its faces.

use super::check::{Kind, MeshReport, check_parts, check_rounded};
use super::points::{Ball, area_vector, bounds, vertex_normal_sums};
use super::topology;
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// A closed triangle mesh: vertices (m, frame of the shape) and faces as triples of vertex numbers,
/// counted from 0, counter-clockwise seen from outside. It bounds one volume: what [`TriMesh::new`] checks
/// holds for every one.
#[derive(Clone, Debug, PartialEq)]
pub struct TriMesh {
    name: String,
    vertices: Vec<Vec3>,
    faces: Vec<[usize; 3]>,
}

/// An edge with its two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Its vertices, in the order in which the first face runs through them.
    pub vertices: [usize; 2],
    /// The faces on its two sides; the second runs through the edge in the other direction.
    pub faces: [usize; 2],
}

impl TriMesh {
    /// A closed, outward oriented mesh; `vertices` in m. Vertices that no face uses are left out.
    ///
    /// # Errors
    /// [`Error::Mesh`] with the first problem that [`check_parts`] calls an error: the mesh is empty, has
    /// an index out of range, a vertex that isn't finite, a face without area or given twice, an
    /// edge without exactly two faces, a face oriented against its neighbours, a vertex whose faces fold back
    /// on each other, an inward orientation, faces that cross, or a piece inside another.
    pub fn new(
        name: impl Into<String>,
        vertices: Vec<Vec3>,
        faces: Vec<[usize; 3]>,
    ) -> Result<Self> {
        let name = name.into();
        let report = check_parts(&name, &vertices, &faces).into_result()?;
        let mut mesh = Self {
            name,
            vertices,
            faces,
        };
        if report.find(Kind::UnreferencedVertex).is_some() {
            mesh.leave_out_loose_vertices();
        }
        Ok(mesh)
    }

    fn leave_out_loose_vertices(&mut self) {
        let mut number = vec![None; self.vertices.len()];
        self.faces
            .iter()
            .flatten()
            .for_each(|&v| number[v] = Some(0));
        let mut kept = Vec::with_capacity(self.vertices.len());
        for (n, x) in number.iter_mut().zip(&self.vertices) {
            if let Some(n) = n {
                *n = kept.len();
                kept.push(*x);
            }
        }
        self.vertices = kept;
        let renumbered = |face: &mut [usize; 3]| *face = face.map(|v| number[v].unwrap_or(v));
        self.faces.iter_mut().for_each(renumbered);
    }

    /// Parts that are known to be a surface.
    pub(super) fn with_parts(name: &str, vertices: Vec<Vec3>, faces: Vec<[usize; 3]>) -> Self {
        Self {
            name: name.into(),
            vertices,
            faces,
        }
    }

    /// The mesh with its vertices moved along `velocities` (m, one a vertex) by `t`, its faces as they are and unchecked: for small changes, along which derivatives
    /// are taken.
    pub(crate) fn displaced(&self, velocities: &[Vec3], t: f64) -> Self {
        let moved = self.vertices.iter().zip(velocities);
        Self {
            name: self.name.clone(),
            vertices: moved.map(|(x, v)| x + t * v).collect(),
            faces: self.faces.clone(),
        }
    }

    /// File or shape name, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Vertices, m, frame of the shape.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Faces: vertex numbers, counter-clockwise seen from outside.
    pub fn faces(&self) -> &[[usize; 3]] {
        &self.faces
    }

    /// The three corners of face `f`, m. Panics if there is no face `f`, as indexing does.
    #[inline]
    pub fn corners(&self, f: usize) -> [Vec3; 3] {
        self.faces[f].map(|v| self.vertices[v])
    }

    /// Area vector of face `f`: its outward normal times its area, m².
    #[inline]
    pub fn area_vector(&self, f: usize) -> Vec3 {
        area_vector(&self.corners(f))
    }

    /// Area of face `f`, m².
    #[inline]
    pub fn area(&self, f: usize) -> f64 {
        self.area_vector(f).norm()
    }

    /// Outward unit normal of face `f`. A face without area, which a checked mesh doesn't have,
    /// gives NaN.
    #[inline]
    pub fn normal(&self, f: usize) -> Vec3 {
        let a = self.area_vector(f);
        a / a.norm()
    }

    /// Centroid of face `f`, m.
    #[inline]
    pub fn centroid(&self, f: usize) -> Vec3 {
        let [a, b, c] = self.corners(f);
        // Relative to a corner: nothing is lost far from the origin.
        a + ((b - a) + (c - a)) / 3.0
    }

    /// All edges, each once, with the two faces on its sides, in the order of their vertices' numbers.
    pub fn edges(&self) -> Vec<Edge> {
        topology::edges(self.faces.iter().copied().enumerate())
            .groups()
            .filter_map(|uses| match uses {
                [a, b] if a.forward != b.forward => {
                    let (first, second) = if a.face < b.face { (a, b) } else { (b, a) };
                    Some(Edge {
                        vertices: first.directed(),
                        faces: [first.face, second.face],
                    })
                }
                _ => None,
            })
            .collect()
    }

    /// Smallest and largest coordinates, m. NaN coordinates are passed over.
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds(self.vertices.iter())
    }

    /// Diagonal of the bounding box, m.
    pub fn diameter(&self) -> f64 {
        let [low, high] = self.bounds();
        (high - low).norm()
    }

    /// A ball around it.
    pub fn bounding_ball(&self) -> Ball {
        Ball::around(self.vertices.iter())
    }

    /// What can be said of the mesh: its size, and warnings.
    pub fn check(&self) -> MeshReport {
        check_parts(&self.name, &self.vertices, &self.faces)
    }

    /// Area of all faces, m².
    pub fn surface_area(&self) -> f64 {
        (0..self.faces.len()).map(|f| self.area(f)).sum()
    }

    /// Unit normals at the vertices: those of the faces around, weighted with their angles there.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vertex_normal_sums(&self.vertices, &self.faces);
        normals.iter_mut().for_each(|n| *n = n.normalize());
        normals
    }

    /// The same surface after a rigid motion.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            name: self.name.clone(),
            vertices: self.vertices.iter().map(|x| pose.apply(x)).collect(),
            faces: self.faces.clone(),
        }
    }

    /// The same surface with rounded coordinates.
    ///
    /// # Errors
    /// [`Error::Mesh`] if faces lose their areas by it, or all its volume.
    pub(crate) fn rounded(&self, round: impl Fn(f64) -> f64) -> Result<Self> {
        let vertices: Vec<Vec3> = self.vertices.iter().map(|x| x.map(&round)).collect();
        check_rounded(&self.name, &vertices, &self.faces).into_result()?;
        Ok(Self::with_parts(&self.name, vertices, self.faces.clone()))
    }

    /// The same surface, larger by `factor` about the origin.
    ///
    /// # Errors
    /// [`Error::Input`] unless `factor` is finite and positive; [`Error::Mesh`] if the result
    /// leaves the range of double precision and so fails the check.
    pub fn scaled(&self, factor: f64) -> Result<Self> {
        check_scale(&format!("mesh {}", self.name), factor)?;
        let vertices = self.vertices.iter().map(|x| x * factor).collect();
        Self::new(self.name.clone(), vertices, self.faces.clone())
    }
}

/// Refuses a factor that lengths can't be multiplied by. `place` begins the message.
pub(crate) fn check_scale(place: &str, factor: f64) -> Result<()> {
    if factor.is_finite() && factor > 0.0 {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: scale"),
        factor,
        "give a finite, positive factor (0.001 for a file in millimetres)",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriMesh {
        let v = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let f = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        TriMesh::new("tetrahedron", v.map(Vec3::from).to_vec(), f).unwrap()
    }

    #[test]
    fn faces_of_a_tetrahedron() {
        let mesh = tetrahedron();
        assert!((mesh.area(3) - 3f64.sqrt() / 2.0).abs() < 1e-15);
        assert!((mesh.normal(3) - Vec3::repeat(1.0 / 3f64.sqrt())).norm() < 1e-15);
        assert!((mesh.centroid(3) - Vec3::repeat(1.0 / 3.0)).norm() < 1e-15);
        let area_sum: Vec3 = (0..4).map(|f| mesh.area_vector(f)).sum();
        assert!(area_sum.norm() < 1e-15);
    }

    #[test]
    fn edges_run_as_their_first_face_does() {
        let mesh = tetrahedron();
        let edges = mesh.edges();
        assert_eq!(edges.len(), 6);
        let runs = |f: usize, [a, b]: [usize; 2]| {
            let c = mesh.faces()[f];
            (0..3).any(|k| c[k] == a && c[(k + 1) % 3] == b)
        };
        for Edge { vertices, faces } in edges {
            assert!(runs(faces[0], vertices));
            assert!(runs(faces[1], [vertices[1], vertices[0]]));
        }
    }

    #[test]
    fn a_scale_that_can_not_be_is_refused() {
        let mesh = tetrahedron();
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
            assert!(mesh.scaled(bad).is_err(), "{bad}");
        }
        let small = mesh.scaled(1e-3).unwrap().diameter();
        assert!((small / mesh.diameter() - 1e-3).abs() < 1e-18);
    }
}
