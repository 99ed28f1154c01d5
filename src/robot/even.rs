//! Surfaces with about as many faces as asked for, as even as they get, with the volume that they had.

use crate::geometry::TriMesh;
use crate::shape::{Shape, build};
use hydrograd_adjoint::lie::{Mat3, Vec3};
use std::path::Path;

/// Times the number asked for within which a number of faces is near it.
const NEAR: f64 = 1.25;
/// Height of a face over its longest edge under which it is a sliver.
const SLIVER: f64 = 0.05;
/// Fewest and, unless many are asked for, most faces of the ball that is laid on a convex surface.
const BALL: [usize; 2] = [5120, 20480];

/// Whether `found` faces are about as many as `asked`.
pub(super) fn is_near(found: usize, asked: usize) -> bool {
    off(found, asked) <= NEAR
}

/// Part of its volume that a body may lose to so many faces: N between points of a ball cut off 11/N of it, which scaling gives back.
pub(super) fn lost_by(faces: usize) -> f64 {
    0.02 + 12.0 / faces as f64
}

/// The larger one over the smaller one.
fn off(found: usize, asked: usize) -> f64 {
    let (found, asked) = (found as f64, asked as f64);
    (found / asked).max(asked / found)
}

/// The same surface with about so many faces and its volume; the nearest that there is where none near that number keeps the shape.
pub(super) fn even(mesh: &TriMesh, faces: usize, convex: bool) -> TriMesh {
    let volume = mesh.mass_properties().volume;
    let most = lost_by(faces);
    let kept = |m: &TriMesh| (m.mass_properties().volume / volume - 1.0).abs() < most;
    let good = |m: &TriMesh| kept(m) && is_near(m.faces().len(), faces);
    let own = coarsened(mesh, faces).filter(kept);
    if let Some(own) = own.as_ref().filter(|m| good(m) && shapeliness(m) >= SLIVER) {
        return of_volume(own, volume);
    }
    // Hulls have slivers, which no edge can be taken from.
    let laid = match convex {
        true => laid(mesh, faces).filter(kept),
        false => None,
    };
    let best = match (&own, &laid) {
        (Some(own), Some(laid)) if good(own) && good(laid) => {
            let worse = shapeliness(own) < 0.5 * shapeliness(laid);
            Some(if worse { laid } else { own })
        }
        (Some(own), _) if good(own) => Some(own),
        (_, Some(laid)) if good(laid) => Some(laid),
        _ => None,
    };
    let split = split(mesh, faces);
    let all = [own.as_ref(), laid.as_ref(), Some(&split), Some(mesh)];
    let nearest = all.into_iter().flatten().min_by(|a, b| {
        let [a, b] = [a, b].map(|m| off(m.faces().len(), faces));
        a.total_cmp(&b)
    });
    of_volume(best.or(nearest).unwrap_or(mesh), volume)
}

/// A surface of so large a volume: scaled about its centroid; as it is where that is no surface.
pub(super) fn of_volume(mesh: &TriMesh, volume: f64) -> TriMesh {
    let own = mesh.mass_properties();
    let factor = (volume / own.volume).cbrt();
    if factor == 1.0 {
        return mesh.clone();
    }
    let scaled = |x: &Vec3| own.centroid + (x - own.centroid) * factor;
    let vertices = mesh.vertices().iter().map(scaled).collect();
    TriMesh::new(mesh.name(), vertices, mesh.faces().to_vec()).unwrap_or_else(|_| mesh.clone())
}

/// Least height of a face over its longest edge.
fn shapeliness(mesh: &TriMesh) -> f64 {
    let of = |f: usize| {
        let [a, b, c] = mesh.corners(f);
        let longest = [a - b, b - c, c - a].map(|e| e.norm_squared());
        2.0 * mesh.area(f) / longest.into_iter().fold(0.0, f64::max)
    };
    (0..mesh.faces().len())
        .map(of)
        .fold(f64::INFINITY, f64::min)
}

/// Faces are cut in four until they are half as many or more.
fn split(mesh: &TriMesh, faces: usize) -> TriMesh {
    let mut fine = mesh.clone();
    while 2 * fine.faces().len() < faces {
        fine = fine.split();
    }
    fine
}

/// Edges are taken away from the surface itself.
fn coarsened(mesh: &TriMesh, faces: usize) -> Option<TriMesh> {
    let mut fine = mesh.clone();
    // Four times as many let the collapse choose.
    while fine.faces().len() < 4 * faces {
        fine = fine.split();
    }
    fine.coarsened(faces).ok()
}

/// A fine ball is laid on a convex surface along the rays from its centroid, stretched as the body is, and edges are taken away from that.
fn laid(mesh: &TriMesh, faces: usize) -> Option<TriMesh> {
    let own = mesh.mass_properties();
    let [fewest, most] = BALL;
    let fine = (16 * faces).clamp(fewest, most).max(4 * faces);
    let ball = build(&Shape::sphere(1.0), Path::new(""), Some(fine)).ok()?;
    // The ellipsoid that has the same moments ∫ x xᵀ dV.
    let moments = Mat3::identity() * (0.5 * own.inertia.trace()) - own.inertia;
    let principal = moments.symmetric_eigen();
    let semi_axes = principal.eigenvalues.map(|l| (5.0 * l / own.volume).sqrt());
    if !semi_axes.iter().all(|l| l.is_finite() && *l > 0.0) {
        return None;
    }
    let mut stretch = principal.eigenvectors * Mat3::from_diagonal(&semi_axes);
    if stretch.determinant() < 0.0 {
        // A mirrored ball would be inside out.
        stretch.column_mut(0).neg_mut();
    }
    // The planes that it lies behind: by where its vertices reach, so that the normal of a sliver cuts nothing off.
    let planes: Vec<(Vec3, f64)> = (0..mesh.faces().len())
        .map(|f| {
            let n = mesh.normal(f);
            let heights = mesh.vertices().iter().map(|x| n.dot(&(x - own.centroid)));
            (n, heights.fold(0.0, f64::max))
        })
        .filter(|(n, reach)| n.iter().all(|x| x.is_finite()) && *reach > 0.0)
        .collect();
    let onto = |x: &Vec3| {
        let ray = stretch * x;
        let ends = planes.iter().filter_map(|(n, reach)| {
            let along = n.dot(&ray);
            (along > 0.0).then(|| reach / along)
        });
        own.centroid + ray * ends.fold(f64::INFINITY, f64::min)
    };
    let vertices = ball.vertices().iter().map(onto).collect();
    let fine = TriMesh::new(mesh.name(), vertices, ball.faces().to_vec()).ok()?;
    fine.coarsened(faces).ok()
}
