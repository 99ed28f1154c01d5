//! Merging of vertices that a file holds several times.

use super::Raw;
use crate::geometry::{bounds, topology, weld};

/// Distance over diameter within which vertices are merged if that closes the surface: single
/// precision of the coordinates, and a little for the exporter.
const TOLERANCE: f64 = 1e-6;

/// Merges vertices where that closes the surface: first those with the same coordinates (`always`:
/// for formats that have no other way to share vertices), then those nearby. The first is kept where fewer
/// holes are left, the second where none is: a report speaks of the holes, not of the seams between faces that have
/// vertices of their own.
pub(super) fn mend(raw: Raw, always: bool) -> Raw {
    // Whatever else is wrong with indices is for the check to say.
    if raw.faces.iter().flatten().any(|&v| v >= raw.vertices.len()) {
        return raw;
    }
    let holes = open_edges(&raw.faces);
    if holes == 0 && !always {
        return raw;
    }
    let (mut same, merged, collapsed) = merge(&raw, 0.0);
    same.repairs.merged_same = merged;
    same.repairs.collapsed = collapsed;
    let left = open_edges(&same.faces);
    if left == 0 {
        return same;
    }
    if let Some(near) = merged_near(&same) {
        return near;
    }
    match always || left < holes {
        true => same,
        false => raw,
    }
}

/// The mesh with nearby vertices merged, if that closes it.
fn merged_near(raw: &Raw) -> Option<Raw> {
    // Loose vertices have no effect, wherever they are.
    let used = raw.faces.iter().flatten().map(|&v| &raw.vertices[v]);
    let [low, high] = bounds(used);
    let largest = low.amax().max(high.amax());
    let tolerance = (TOLERANCE * (high - low).norm()).max(4.0 * f64::from(f32::EPSILON) * largest);
    if !tolerance.is_finite() {
        return None;
    }
    let (mut near, merged, collapsed) = merge(raw, tolerance);
    if near.faces.is_empty() || open_edges(&near.faces) > 0 {
        return None;
    }
    near.repairs.merged_near = merged;
    near.repairs.collapsed += collapsed;
    Some(near)
}

fn is_proper([a, b, c]: &[usize; 3]) -> bool {
    a != b && b != c && c != a
}

fn open_edges(faces: &[[usize; 3]]) -> usize {
    let proper = faces.iter().copied().enumerate();
    let edges = topology::edges(proper.filter(|(_, f)| is_proper(f)));
    edges.groups().filter(|uses| uses.len() == 1).count()
}

/// The mesh with vertices within `tolerance` merged and faces that collapsed left out; the
/// numbers of both.
fn merge(raw: &Raw, tolerance: f64) -> (Raw, usize, usize) {
    let first = weld::representatives(&raw.vertices, tolerance);
    let mut number = vec![0; first.len()];
    let mut vertices = Vec::new();
    for v in 0..first.len() {
        number[v] = if first[v] == v {
            vertices.push(raw.vertices[v]);
            vertices.len() - 1
        } else {
            number[first[v]]
        };
    }
    let faces = raw.faces.iter().map(|face| face.map(|v| number[v]));
    let out = Raw {
        vertices,
        faces: faces.filter(is_proper).collect(),
        repairs: raw.repairs,
    };
    let merged = raw.vertices.len() - out.vertices.len();
    let collapsed = raw.faces.len() - out.faces.len();
    (out, merged, collapsed)
}
