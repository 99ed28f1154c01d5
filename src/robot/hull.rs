//! Convex meshes: hulls with few faces and with many, and halves of them.

use super::even::of_volume;
use crate::Result;
use crate::geometry::TriMesh;
use crate::shape::file::{FileMesh, Repairs};
use hydrograd_adjoint::lie::Vec3;
use std::collections::HashSet;

/// Most faces of a hull that things are cut from and touched by.
pub(super) const MOST_FACES: usize = 96;
/// Most faces of a hull that the water sees, before it gets those asked for.
const FINE_FACES: usize = 2048;
/// Of the extent, the grids that points are put on before their hull is sought: the first merges what is the same, the others are tried where the
/// first has none, since points that are nearly in one plane may have no hull to rounding.
const GRIDS: [f64; 3] = [1e-7, 1e-5, 1e-3];

/// The convex hull of points, with at most [`MOST_FACES`] faces.
///
/// None of points without a volume.
///
/// # Errors
/// As [`FileMesh::hull`].
pub(super) fn hull(name: &str, points: &[Vec3]) -> Result<Option<TriMesh>> {
    Ok(whole_hull(name, points)?.map(|whole| fewer(whole, MOST_FACES)))
}

/// The convex hull of points as the water sees it: as many faces as it has or, with its volume, as many as can be worked with.
///
/// None of points without a volume.
///
/// # Errors
/// As [`hull`].
pub(super) fn fine_hull(name: &str, points: &[Vec3]) -> Result<Option<TriMesh>> {
    let Some(whole) = whole_hull(name, points)? else {
        return Ok(None);
    };
    let volume = whole.mass_properties().volume;
    Ok(Some(match whole.faces().len() <= FINE_FACES {
        true => whole,
        false => of_volume(&fewer(whole, FINE_FACES), volume),
    }))
}

/// A hull within or near another with at most so many faces, where there is one.
fn fewer(whole: TriMesh, most: usize) -> TriMesh {
    if whole.faces().len() <= most {
        return whole;
    }
    // Vertices that are left move a little off the hull: the hull of these has no more faces than they.
    let fewer = whole.coarsened(most);
    let hull = fewer.and_then(|fewer| whole_hull(whole.name(), fewer.vertices()));
    hull.ok().flatten().unwrap_or(whole)
}

fn whole_hull(name: &str, points: &[Vec3]) -> Result<Option<TriMesh>> {
    let mut first = None;
    for grid in GRIDS {
        match on_grid(name, points, grid).solid_hull() {
            Ok(Some(hull)) => return Ok(Some(hull)),
            other => {
                first.get_or_insert(other);
            }
        }
    }
    first.unwrap_or(Ok(None))
}

/// The points as faces, those of one place once.
fn on_grid(name: &str, points: &[Vec3], grid: f64) -> FileMesh {
    let finite = points.iter().filter(|x| x.iter().all(|x| x.is_finite()));
    let start = [Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)];
    let [low, high] = finite.fold(start, |[low, high], x| [low.inf(x), high.sup(x)]);
    let cell = (grid * (high - low).norm()).max(f64::MIN_POSITIVE);
    let mut seen = HashSet::new();
    let mut vertices: Vec<Vec3> = Vec::new();
    for x in points {
        let key = ((x - low) / cell).map(|x| x.round() as i64);
        if seen.insert([key.x, key.y, key.z]) {
            vertices.push(*x);
        }
    }
    let n = vertices.len();
    let face = |i: usize| [i, (i + 1).min(n - 1), (i + 2).min(n - 1)];
    FileMesh {
        name: name.to_owned(),
        faces: (0..n).step_by(3).map(face).collect(),
        vertices,
        repairs: Repairs::default(),
    }
}

/// The part of a convex mesh where `normal`·x ≤ `level`, with at most [`MOST_FACES`] faces; none if nothing with a volume is left, or no hull of what is left is
/// found.
pub(super) fn half(mesh: &TriMesh, normal: &Vec3, level: f64) -> Option<TriMesh> {
    part(mesh, normal, level, hull)
}

/// The same, as the water sees it.
pub(super) fn fine_half(mesh: &TriMesh, normal: &Vec3, level: f64) -> Option<TriMesh> {
    part(mesh, normal, level, fine_hull)
}

fn part(
    mesh: &TriMesh,
    normal: &Vec3,
    level: f64,
    hull: impl Fn(&str, &[Vec3]) -> Result<Option<TriMesh>>,
) -> Option<TriMesh> {
    let height = |v: usize| normal.dot(&mesh.vertices()[v]) - level;
    let all = mesh.vertices().iter();
    let mut points: Vec<Vec3> = all.filter(|x| normal.dot(x) <= level).copied().collect();
    if points.len() == mesh.vertices().len() {
        return Some(mesh.clone());
    }
    for edge in mesh.edges() {
        let [a, b] = edge.vertices;
        let (from, to) = (height(a), height(b));
        if (from < 0.0) != (to < 0.0) {
            let (x, y) = (mesh.vertices()[a], mesh.vertices()[b]);
            points.push(x + (y - x) * (from / (from - to)));
        }
    }
    if points.len() < 4 {
        return None;
    }
    hull(mesh.name(), &points).ok().flatten()
}

/// The direction from convex body `a` to `b` along which they lie least in each other, the level that `a` reaches along it, and how deep that is past `b`'s beginning: the
/// normals of both bodies' faces are tried.
pub(super) fn least_overlap(a: &TriMesh, b: &TriMesh) -> Option<(Vec3, f64, f64)> {
    let reach = |m: &TriMesh, n: &Vec3| {
        let heights = m.vertices().iter().map(|x| n.dot(x));
        heights.fold(f64::NEG_INFINITY, f64::max)
    };
    let of_a = (0..a.faces().len()).map(|f| a.normal(f));
    let of_b = (0..b.faces().len()).map(|f| -b.normal(f));
    let overlaps = of_a.chain(of_b).map(|n| {
        let level = reach(a, &n);
        (n, level, level + reach(b, &-n))
    });
    overlaps
        .filter(|(_, _, depth)| depth.is_finite())
        .min_by(|x, y| x.2.total_cmp(&y.2))
}
