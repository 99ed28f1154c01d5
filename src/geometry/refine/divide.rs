//! Finer faces everywhere on a surface that stays where it is.
//!
//! Edges are split in their middles, the longest first, and diagonals of flat parts are chosen anew after each ([`super::flip`]), so that long thin
//! faces don't stay thin where the surface has room beside them.

use super::bisection::{Bisection, MEAN_AREA, key};
use super::exact::ExactSurface;
use super::flip::edges;
use crate::geometry::mesh::TriMesh;
use std::collections::BinaryHeap;

/// What the length of an edge within a flat part counts beside that of one between two: of a long strip the sides are split, and not
/// its diagonals, which halve its width. Those of squares are longer by more.
const WITHIN: f64 = 0.75;
/// Bits of a squared length that rounding may change: at another scale a mesh is divided the same way.
const ROUNDING: u64 = (1 << 16) - 1;

impl TriMesh {
    /// The longest edge that the surface has where bisection makes about so many faces of it, m.
    pub(crate) fn edge_of(&self, faces: usize) -> f64 {
        (self.surface_area() / (MEAN_AREA * faces as f64)).sqrt()
    }

    /// Its longest edge, m.
    pub(crate) fn longest_edge(&self) -> f64 {
        let squared = |f: usize| {
            let [a, b, c] = self.corners(f);
            [b - a, c - b, a - c].map(|e| e.norm_squared())
        };
        let all = (0..self.faces().len()).flat_map(squared);
        all.fold(0.0, f64::max).sqrt()
    }
}

/// The same surface with edges split until none is longer than `edge` (m), or until there are `most` faces. Its own vertices come
/// first, as they were.
pub(crate) fn divided(mesh: &TriMesh, edge: f64, most: usize) -> TriMesh {
    let mut work = Bisection::new(mesh, ExactSurface::Flat);
    let own = mesh.edges().into_iter().map(|e| e.vertices);
    work.flip_all(own.map(|[a, b]| key(a, b)).collect());
    let mut waiting = BinaryHeap::new();
    wait(&work, 0..work.faces.len(), edge, &mut waiting);
    while let Some((_, ends)) = waiting.pop() {
        // Some were split or flipped since.
        let Some(&faces) = work.sides.get(&ends) else {
            continue;
        };
        if work.faces.len() + 2 > most {
            break;
        }
        let middle = work.vertices.len();
        let split = work.split(ends, faces);
        let around = split.into_iter().flat_map(|f| edges(work.faces[f]));
        let around = around.filter(|ends| !ends.contains(&middle)).collect();
        let mut changed = work.flip_all(around);
        changed.extend(split);
        changed.sort_unstable();
        changed.dedup();
        wait(&work, changed, edge, &mut waiting);
    }
    // Points between two others cross nothing that these didn't.
    TriMesh::with_parts(mesh.name(), work.vertices, work.faces)
}

/// An edge that is too long: what its length counts (bits of positive numbers sort as the numbers do), and its vertices.
type TooLong = (u64, [usize; 2]);

/// Puts edges of faces that are too long among those that wait.
fn wait(
    work: &Bisection,
    faces: impl IntoIterator<Item = usize>,
    edge: f64,
    waiting: &mut BinaryHeap<TooLong>,
) {
    for ends in faces.into_iter().flat_map(|f| edges(work.faces[f])) {
        let [a, b] = ends.map(|v| work.vertices[v]);
        let squared = (b - a).norm_squared();
        if squared > edge * edge {
            let part = if work.is_flat(ends) { WITHIN } else { 1.0 };
            let counts = (part * part * squared).to_bits() + ROUNDING / 2;
            waiting.push((counts & !ROUNDING, ends));
        }
    }
}
