//! The convex hull of what a file holds, by `parry3d-f64`: what a mesh that can't be simulated may be replaced by.

use super::FileMesh;
use crate::geometry::{TriMesh, bounds, has_area};
use crate::{Error, Result};
use hydrograd_adjoint::lie::Vec3;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Thickness over length up to which points that have no hull are called flat: single precision of the coordinates, and a little.
const FLAT: f64 = 1e-6;
/// Most times that the hull is sought anew without vertices in line; each time about half of those of one line go.
const ROUNDS: usize = 40;

impl FileMesh {
    /// The convex hull of the vertices that faces use, in the file's place: closed, whatever was wrong with the mesh. Of vertices in line, to rounding, those between others may be left out.
    ///
    /// # Errors
    /// [`Error::Input`] of vertices that aren't finite, are fewer than four, or lie in a plane, to rounding, and of faces that name vertices that aren't there; [`Error::Mesh`] where no hull is
    /// found for another reason.
    pub fn hull(&self) -> Result<TriMesh> {
        let flat = || {
            Error::input(
                self.hull_name(),
                format!("{} vertices", 3 * self.faces.len()),
                "there is no hull with a volume: the vertices lie on a line or in a plane; give the part thickness",
            )
        };
        self.solid_hull()?.ok_or_else(flat)
    }

    fn hull_name(&self) -> String {
        format!("convex hull of {}", self.name)
    }

    /// The same; none of vertices that are fewer than four or lie in a plane, to rounding.
    pub(crate) fn solid_hull(&self) -> Result<Option<TriMesh>> {
        let name = self.hull_name();
        let refused = |given: String, remedy: &str| Error::input(&name, given, remedy.to_owned());
        let used = self.faces.iter().flatten();
        let points: Option<Vec<Vec3>> = used.map(|v| self.vertices.get(*v).copied()).collect();
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
        match found(&name, &points) {
            Ok(hull) => Ok(Some(hull)),
            Err(_) if is_flat(&points) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// The hull, sought anew without vertices that lie between two others as long as they make faces without area.
fn found(name: &str, points: &[Vec3]) -> Result<TriMesh> {
    let (mut vertices, mut faces) = sought(name, points)?;
    let [low, high] = bounds(vertices.iter());
    for _ in 0..ROUNDS {
        let kept = without_middles(&vertices, &faces, (high - low).norm());
        if kept.len() == vertices.len() {
            break;
        }
        (vertices, faces) = sought(name, &kept)?;
    }
    TriMesh::new(name, vertices, faces)
}

/// What the other crate finds.
fn sought(name: &str, points: &[Vec3]) -> Result<(Vec<Vec3>, Vec<[usize; 3]>)> {
    let given: Vec<Vector> = (points.iter())
        .map(|x| Vector::new(x.x, x.y, x.z))
        .collect();
    let failed = |why: String| Error::Mesh {
        name: name.to_owned(),
        problem: format!("none is found: {why}"),
        location: format!("{} vertices", points.len()),
        remedy:
            "merge vertices that are nearly at the same place, or export the mesh with fewer faces"
                .into(),
    };
    // It may panic on points that its own checks let through.
    let (vertices, faces) = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&given)))
        .map_err(|_| failed("the search broke off".into()))?
        .map_err(|e| failed(e.to_string()))?;
    let vertices = vertices.iter().map(|x| Vec3::new(x.x, x.y, x.z)).collect();
    let faces = faces.iter().map(|f| f.map(|v| v as usize)).collect();
    Ok((vertices, faces))
}

/// The vertices but of each face without area the one opposite its longest side, which is on that side to rounding. No face loses a second one, so that what is nearly at one place stays there
/// once.
fn without_middles(vertices: &[Vec3], faces: &[[usize; 3]], diameter: f64) -> Vec<Vec3> {
    let mut kept = vec![true; vertices.len()];
    for face in faces {
        let corners = face.map(|v| vertices[v]);
        if has_area(&corners, diameter) || face.iter().any(|v| !kept[*v]) {
            continue;
        }
        let opposite = |k: usize| (corners[(k + 1) % 3] - corners[(k + 2) % 3]).norm();
        let middle = (0..3).max_by(|a, b| opposite(*a).total_cmp(&opposite(*b)));
        kept[face[middle.unwrap_or(0)]] = false;
    }
    let all = vertices.iter().zip(kept);
    all.filter_map(|(x, kept)| kept.then_some(*x)).collect()
}

/// Whether points lie in a plane, to rounding.
fn is_flat(points: &[Vec3]) -> bool {
    let Some(first) = points.first() else {
        return true;
    };
    let farthest = |from: &dyn Fn(&Vec3) -> f64| {
        let all = points.iter().max_by(|a, b| from(a).total_cmp(&from(b)));
        *all.unwrap_or(first)
    };
    let long = farthest(&|x| (x - first).norm()) - first;
    let across = |x: &Vec3| long.cross(&(x - first));
    let wide = across(&farthest(&|x| across(x).norm()));
    let high = |x: &Vec3| wide.dot(&(x - first)).abs();
    let thickness = high(&farthest(&high)) / wide.norm();
    // So that NaN of points in line counts as flat.
    let is_thick = thickness > FLAT * long.norm();
    !is_thick
}
