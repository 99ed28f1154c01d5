//! Flat faces of a convex triangle mesh.

use crate::error::{Error, Result};
use crate::geometry::TriMesh;
use hydrograd_adjoint::lie::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// Share of the diameter within which triangles lie in one plane: meshes in files are rounded to
/// single precision.
const FLAT: f64 = 1e-6;
/// Share of the diameter by which a vertex may lie outside the plane of a face.
const CONVEX: f64 = 1e-5;
/// Most triangles: every face is held against every vertex.
const MOST: usize = 20_000;

/// Corners and, for every flat face, the numbers of its corners, counter-clockwise seen from
/// outside.
///
/// # Errors
/// As [`ContactShape::of_mesh`](super::ContactShape::of_mesh).
pub(super) fn facets(mesh: &TriMesh) -> Result<(Vec<Vec3>, Vec<Vec<usize>>)> {
    let count = mesh.faces().len();
    if count > MOST {
        return Err(unsupported(
            mesh,
            format!("it has {count} triangles, and contact holds every face against every vertex"),
            format!("give its convex hull with at most {MOST} triangles"),
        ));
    }
    let (groups, count) = flat_groups(mesh);
    check_convex(mesh, &groups, count)?;
    // A corner has three faces or more about it; the others lie within a face or a straight edge.
    let mut about = vec![BTreeSet::new(); mesh.vertices().len()];
    for (f, face) in mesh.faces().iter().enumerate() {
        face.iter().for_each(|&v| {
            about[v].insert(groups[f]);
        });
    }
    let kept: Vec<usize> = (0..about.len()).filter(|&v| about[v].len() > 2).collect();
    let numbers: BTreeMap<usize, usize> = kept.iter().enumerate().map(|(k, &v)| (v, k)).collect();
    let face = |g| {
        let border = border(mesh, &groups, g)?;
        let corners = border.iter().filter_map(|v| numbers.get(v).copied());
        Some(corners.collect::<Vec<usize>>()).filter(|c| c.len() > 2)
    };
    let Some(loops) = (0..count).map(face).collect() else {
        return Err(Error::Mesh {
            name: mesh.name().into(),
            problem: "triangles in one plane don't make a face with one border".into(),
            location: format!("diameter {:.3e} m", mesh.diameter()),
            remedy: "for contact use its convex hull, with flat parts flat to rounding".into(),
        });
    };
    let corners = kept.iter().map(|&v| mesh.vertices()[v]).collect();
    Ok((corners, loops))
}

/// The number of the flat face that each triangle belongs to, grown from the largest triangles, and how many
/// there are.
fn flat_groups(mesh: &TriMesh) -> (Vec<usize>, usize) {
    const NONE: usize = usize::MAX;
    let slack = FLAT * mesh.diameter();
    let mut neighbors = vec![Vec::new(); mesh.faces().len()];
    for edge in mesh.edges() {
        let [f, g] = edge.faces;
        neighbors[f].push(g);
        neighbors[g].push(f);
    }
    let mut order: Vec<usize> = (0..mesh.faces().len()).collect();
    order.sort_by(|&f, &g| mesh.area(g).total_cmp(&mesh.area(f)).then(f.cmp(&g)));
    let mut groups = vec![NONE; order.len()];
    let mut count = 0;
    for seed in order {
        if groups[seed] != NONE {
            continue;
        }
        let (normal, origin) = (mesh.normal(seed), mesh.centroid(seed));
        let flat = |f: usize| {
            let within = |x: &Vec3| (x - origin).dot(&normal).abs() <= slack;
            mesh.corners(f).iter().all(within) && mesh.area_vector(f).dot(&normal) > 0.0
        };
        groups[seed] = count;
        let mut waiting = vec![seed];
        while let Some(f) = waiting.pop() {
            for &g in &neighbors[f] {
                if groups[g] == NONE && flat(g) {
                    groups[g] = count;
                    waiting.push(g);
                }
            }
        }
        count += 1;
    }
    (groups, count)
}

/// # Errors
/// [`Error::Unsupported`] if a vertex lies outside a face, with the farthest.
fn check_convex(mesh: &TriMesh, groups: &[usize], count: usize) -> Result<()> {
    let mut areas = vec![Vec3::zeros(); count];
    let mut origins = vec![Vec3::zeros(); count];
    for (f, &g) in groups.iter().enumerate() {
        areas[g] += mesh.area_vector(f);
        origins[g] = mesh.centroid(f);
    }
    let mut worst = (0.0, Vec3::zeros());
    for (area, origin) in areas.iter().zip(&origins) {
        let normal = area.normalize();
        for x in mesh.vertices() {
            let height = (x - origin).dot(&normal);
            if height > worst.0 {
                worst = (height, *x);
            }
        }
    }
    let diameter = mesh.diameter();
    if worst.0 <= CONVEX * diameter {
        return Ok(());
    }
    Err(unsupported(
        mesh,
        format!(
            "it isn't convex: the vertex at {:?} m lies {:.3e} m outside the plane of a face, {:.1e} \
             of the diameter; {CONVEX:.0e} is allowed",
            worst.1.as_slice(),
            worst.0,
            worst.0 / diameter
        ),
        "give its convex hull, or several convex bodies joined together".into(),
    ))
}

/// Vertices around a group of triangles; none if its border isn't one loop.
fn border(mesh: &TriMesh, groups: &[usize], group: usize) -> Option<Vec<usize>> {
    let members = mesh.faces().iter().zip(groups);
    let members = members.filter(|(_, g)| **g == group);
    let sides = members.flat_map(|(&[a, b, c], _)| [[a, b], [b, c], [c, a]]);
    let sides: BTreeSet<[usize; 2]> = sides.collect();
    let outer = || sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a]));
    let next: BTreeMap<usize, usize> = outer().map(|&[a, b]| (a, b)).collect();
    let count = outer().count();
    let first = *next.first_key_value()?.0;
    let mut out = vec![first];
    let mut at = *next.get(&first)?;
    while at != first && out.len() <= count {
        out.push(at);
        at = *next.get(&at)?;
    }
    (out.len() == count).then_some(out)
}

fn unsupported(mesh: &TriMesh, why: String, instead: String) -> Error {
    Error::Unsupported {
        what: format!("contact of the mesh {}", mesh.name()),
        why,
        instead,
    }
}
