//! The convex hull of what a file holds, by `parry3d-f64`: what a mesh that can't be simulated may be replaced by.

use super::FileMesh;
use crate::geometry::TriMesh;
use crate::{Error, Result};
use hydrograd_adjoint::lie::Vec3;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;
use std::panic::{AssertUnwindSafe, catch_unwind};

impl FileMesh {
    /// The convex hull of the vertices that faces use, in the file's place: closed, whatever was wrong with the mesh.
    ///
    /// # Errors
    /// [`Error::Mesh`] of vertices that aren't finite, are fewer than four, or lie in a plane, to rounding; [`Error::Input`] of faces that name vertices that aren't there.
    pub fn hull(&self) -> Result<TriMesh> {
        let name = format!("convex hull of {}", self.name);
        let refused = |given: String, remedy: &str| Error::input(&name, given, remedy.to_owned());
        let used = self.faces.iter().flatten();
        let points: Option<Vec<&Vec3>> = used.map(|v| self.vertices.get(*v)).collect();
        let Some(points) = points else {
            return Err(refused(
                "a face of a vertex that isn't there".into(),
                "export the mesh again",
            ));
        };
        if let Some(bad) = points.iter().find(|x| !x.iter().all(|x| x.is_finite())) {
            return Err(refused(
                format!("a vertex at {:?}", bad.as_slice()),
                "must be finite: export the mesh again",
            ));
        }
        let points: Vec<Vector> = (points.iter())
            .map(|x| Vector::new(x.x, x.y, x.z))
            .collect();
        // It may panic on points that its own checks let through.
        let found = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&points)));
        let Ok(Ok((vertices, faces))) = found else {
            return Err(refused(
                format!("{} vertices", points.len()),
                "there is no hull with a volume: the vertices lie on a line or in a plane; give the part thickness",
            ));
        };
        let vertices = vertices.iter().map(|x| Vec3::new(x.x, x.y, x.z)).collect();
        let faces = faces.iter().map(|f| f.map(|v| v as usize)).collect();
        TriMesh::new(name.clone(), vertices, faces)
    }
}
