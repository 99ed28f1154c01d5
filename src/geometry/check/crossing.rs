//! Faces that cross, and pieces inside one another: what keeps a closed surface from having 1 for its winding number inside and 0
//! outside.
//!
//! Beyond a transversal crossing the surface winds one time more, or one time less, than a solid's can, and where nothing crosses a closed piece winds once or
//! not at all. So both are found without a winding number at every point.

use crate::geometry::boxes::{Node, tree};
use crate::geometry::exact::Exact;
use crate::geometry::points::{bounds, winding_number};
use crate::geometry::topology::{Component, Edges};
use crate::geometry::triangle::Triangle;
use hydrograd_adjoint::lie::Vec3;
use rayon::prelude::*;

/// Faces that are looked at before it is asked whether that is enough.
const ROUND: usize = 2048;
/// Pairs of crossing faces after which no more are looked for.
pub(super) const MANY: usize = 1000;
/// Pairs of near faces, at most, that are looked at: some ten seconds. Meshes of even faces have ten or twenty a face.
pub(super) const MOST: usize = 400_000_000;

/// What was found of a surface's crossings.
pub(super) struct Crossings {
    /// Pairs of faces, the smaller number first, ascending.
    pub pairs: Vec<[usize; 2]>,
    /// Faces that were looked at.
    pub searched: usize,
}

/// The faces of a closed surface, oriented alike, that cross; `edges` are all of its edges.
pub(super) fn crossings(vertices: &[Vec3], faces: &[[usize; 3]], edges: &Edges) -> Crossings {
    let triangles: Vec<Triangle> = faces
        .iter()
        .map(|f| Triangle::new(f.map(|v| vertices[v])))
        .collect();
    let middle = |f: usize| triangles[f].corners.iter().map(|x| x / 3.0).sum();
    let (nodes, order) = tree(&triangles, middle);
    let [low, high] = bounds(triangles.iter().flat_map(|t| &t.corners));
    let size = (high - low).norm();
    let exact = Exact::new(vertices, faces, across(faces, edges), size);
    let mut found = Crossings {
        pairs: Vec::new(),
        searched: 0,
    };
    let mut tested = 0;
    while found.searched < faces.len() && found.pairs.len() <= MANY && tested <= MOST {
        let round = found.searched..faces.len().min(found.searched + ROUND);
        let looked: Vec<(usize, Vec<[usize; 2]>)> = round
            .clone()
            .into_par_iter()
            .map(|i| {
                let f = order[i];
                let near = near(&nodes, i, &triangles[f], size);
                let others = near.iter().map(|&j| order[j]);
                let others = others.filter(|&g| exact.near(f, g) && exact.cross(f, g));
                (near.len(), others.map(|g| [f.min(g), f.max(g)]).collect())
            })
            .collect();
        for (count, pairs) in looked {
            tested += count;
            found.pairs.extend(pairs);
        }
        found.searched = round.end;
    }
    found.pairs.sort_unstable();
    found
}

/// Faces after number `i` of a tree, by their numbers there, whose leaves touch the box around a triangle.
fn near(nodes: &[Node], i: usize, triangle: &Triangle, size: f64) -> Vec<usize> {
    let [low, high] = bounds(triangle.corners.iter());
    let center = low + (high - low) * 0.5;
    let half = (high - center).sup(&(center - low));
    // Rounding of the boxes must hide nothing.
    let reach = center.amax() + size;
    let slack = 8.0 * f64::EPSILON * reach;
    let mut found = Vec::new();
    let mut stack = vec![0];
    while let Some(n) = stack.pop() {
        let node: &Node = &nodes[n];
        let apart = (node.center - center).abs() - node.half - half;
        if node.faces.end <= i + 1 || apart.max() > slack {
            continue;
        }
        match node.second {
            Some(second) => stack.extend([second, n + 1]),
            None => found.extend(node.faces.clone().filter(|&j| j > i)),
        }
    }
    found
}

/// The face across each edge of each face, from corner k to the next; of a closed surface.
fn across(faces: &[[usize; 3]], edges: &Edges) -> Vec<[usize; 3]> {
    let mut out = vec![[usize::MAX; 3]; faces.len()];
    for uses in edges.groups() {
        let [a, b] = uses else { continue };
        for (one, other) in [(a, b), (b, a)] {
            let from = one.directed()[0];
            let k = faces[one.face].iter().position(|&v| v == from);
            out[one.face][k.unwrap_or(0)] = other.face;
        }
    }
    out
}

/// The first faces of pieces that lie inside others; of pieces that don't cross.
pub(super) fn nested(vertices: &[Vec3], faces: &[[usize; 3]], pieces: &[Component]) -> Vec<usize> {
    let corners = |piece: &Component| -> Vec<[Vec3; 3]> {
        let faces = piece.faces.iter().map(|&f| faces[f]);
        faces.map(|f| f.map(|v| vertices[v])).collect()
    };
    let all: Vec<_> = pieces.iter().map(corners).collect();
    let boxes: Vec<_> = all.iter().map(|t| bounds(t.iter().flatten())).collect();
    let within = |inner: usize, outer: usize| {
        let ([low, high], [from, to]) = (boxes[inner], boxes[outer]);
        let held = (0..3).all(|i| low[i] >= from[i] && high[i] <= to[i]);
        inner != outer && held && {
            // Where they touch the surface winds by a part: there the next face tells.
            let middle = |t: &[Vec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
            let winds = |t| winding_number(all[outer].iter(), &middle(t));
            let mut told = all[inner].iter().map(winds);
            told.find(|w| (w - w.round()).abs() < 0.01)
                .is_some_and(|w| w.round() != 0.0)
        }
    };
    (0..pieces.len())
        .into_par_iter()
        .filter(|&inner| (0..pieces.len()).any(|outer| within(inner, outer)))
        .map(|inner| pieces[inner].faces[0])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriMesh;
    use crate::geometry::tests::{ball, cuboid, turned};
    use crate::geometry::topology;

    /// Two meshes as one list of faces.
    fn both(a: &TriMesh, b: &TriMesh) -> (Vec<Vec3>, Vec<[usize; 3]>) {
        let first = a.vertices().len();
        let faces = b.faces().iter().map(|f| f.map(|v| v + first));
        (
            [a.vertices(), b.vertices()].concat(),
            a.faces().iter().copied().chain(faces).collect(),
        )
    }

    #[test]
    fn the_pairs_are_those_of_all_one_by_one() {
        let beside = |x: [f64; 3]| cuboid([1.0; 3]).transformed(&turned([0.0; 3], x));
        let thrown = |mesh: TriMesh| mesh.transformed(&turned([0.3, 0.5, -0.2], [0.7, 0.1, 0.2]));
        // In general positions, and with planes and edges on one another; the last ones touch.
        for (a, b, crosses) in [
            (ball(), thrown(ball()), true),
            (cuboid([1.0; 3]), thrown(cuboid([1.0, 0.7, 0.4])), true),
            (ball(), cuboid([1.5, 1.5, 0.3]), true),
            (cuboid([1.0; 3]), beside([0.25, 0.5, 0.0]), true),
            (cuboid([1.0; 3]), beside([0.5, 0.5, 0.5]), true),
            (cuboid([1.0; 3]), beside([1.0, 1.0, 0.25]), false),
        ] {
            let (vertices, faces) = both(&a, &b);
            let edges = topology::edges(faces.iter().copied().enumerate());
            let found = crossings(&vertices, &faces, &edges);
            assert_eq!(found.searched, faces.len());
            let [low, high] = bounds(vertices.iter());
            let size = (high - low).norm();
            let exact = Exact::new(&vertices, &faces, across(&faces, &edges), size);
            let all = (0..faces.len()).flat_map(|f| (f + 1..faces.len()).map(move |g| [f, g]));
            let one_by_one: Vec<[usize; 2]> = all.filter(|[f, g]| exact.cross(*f, *g)).collect();
            assert_eq!(found.pairs, one_by_one);
            assert_eq!(!one_by_one.is_empty(), crosses);
        }
    }
}
