//! The triangle mesh and the geometry of its faces.

use super::check::{check, check_parts};
use super::mass::MassProperties;
use super::topology;
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// A triangle mesh: vertices (m, frame of the shape) and faces as triples of vertex numbers,
/// counted from 0, counter-clockwise seen from outside.
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
    /// A closed, outward oriented mesh; `vertices` in m.
    ///
    /// # Errors
    /// [`Error::Mesh`] with the first problem that [`check()`] calls an error: the mesh is empty, has
    /// an index out of range, a vertex that isn't finite, a face without area or given twice, an
    /// edge without exactly two faces, a face turned against its neighbours, an inward
    /// orientation, or several separate pieces.
    pub fn new(
        name: impl Into<String>,
        vertices: Vec<Vec3>,
        faces: Vec<[usize; 3]>,
    ) -> Result<Self> {
        let name = name.into();
        check_parts(&name, &vertices, &faces).into_result()?;
        Ok(Self {
            name,
            vertices,
            faces,
        })
    }

    /// Any set of faces whose indices exist: for meshes that are still to be checked or mended.
    ///
    /// # Errors
    /// [`Error::Mesh`] if a face names a vertex that doesn't exist.
    pub fn unchecked(
        name: impl Into<String>,
        vertices: Vec<Vec3>,
        faces: Vec<[usize; 3]>,
    ) -> Result<Self> {
        let name = name.into();
        let count = vertices.len();
        if let Some((f, face)) = faces
            .iter()
            .enumerate()
            .find(|(_, face)| face.iter().any(|&v| v >= count))
        {
            return Err(Error::Mesh {
                name,
                problem: format!("vertex index out of range: {face:?} with {count} vertices"),
                location: format!("face {f}, counted from 0"),
                remedy: "count vertices from 0, or add the missing vertices".into(),
            });
        }
        Ok(Self {
            name,
            vertices,
            faces,
        })
    }

    /// Parts that are known to be a surface.
    pub(super) fn with_parts(name: &str, vertices: Vec<Vec3>, faces: Vec<[usize; 3]>) -> Self {
        Self {
            name: name.into(),
            vertices,
            faces,
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

    /// All edges, each once, with the two faces on its sides. Edges without exactly two
    /// oppositely running faces are left out; a mesh from [`TriMesh::new`] has none of those.
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

    /// Volume, area, centroid and inertia.
    pub fn mass_properties(&self) -> MassProperties {
        MassProperties::of(self)
    }

    /// The same surface after a rigid motion.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            name: self.name.clone(),
            vertices: self.vertices.iter().map(|x| pose.apply(x)).collect(),
            faces: self.faces.clone(),
        }
    }

    /// The same surface, larger by `factor` about the origin.
    ///
    /// # Errors
    /// [`Error::Input`] unless `factor` is finite and positive; [`Error::Mesh`] if the result
    /// leaves the range of double precision and so fails the check.
    pub fn scaled(&self, factor: f64) -> Result<Self> {
        if !(factor.is_finite() && factor > 0.0) {
            return Err(Error::input(
                format!("mesh {}: scale", self.name),
                factor,
                "give a finite, positive factor (0.001 for a file in millimetres)",
            ));
        }
        let scaled = Self {
            name: self.name.clone(),
            vertices: self.vertices.iter().map(|x| x * factor).collect(),
            faces: self.faces.clone(),
        };
        // Only what scaling can break is refused here: an unchecked mesh may be scaled too.
        if check(self).is_ok() {
            check(&scaled).into_result()?;
        }
        Ok(scaled)
    }
}

/// Normal times area of a triangle.
#[inline]
pub(super) fn area_vector([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a)) * 0.5
}

/// Smallest and largest coordinates; zero without points.
pub(super) fn bounds<'a>(points: impl Iterator<Item = &'a Vec3>) -> [Vec3; 2] {
    let mut low = Vec3::repeat(f64::INFINITY);
    let mut high = Vec3::repeat(f64::NEG_INFINITY);
    for p in points {
        for i in 0..3 {
            low[i] = low[i].min(p[i]);
            high[i] = high[i].max(p[i]);
        }
    }
    if low.iter().zip(high.iter()).any(|(l, h)| l > h) {
        return [Vec3::zeros(), Vec3::zeros()];
    }
    [low, high]
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
