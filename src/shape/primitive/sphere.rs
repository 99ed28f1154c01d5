//! Spheres and ellipsoids: subdivided icosahedra.

use super::Parts;
use crate::shape::description::MAX_FACES;
use hydrograd_adjoint::lie::Vec3;
use std::collections::HashMap;

/// An ellipsoid with the given semi-axes (m) along x, y, z, with its vertices on the surface: a
/// subdivided icosahedron, stretched. Faces: the 20 n² nearest to `target`.
pub(in crate::shape) fn ellipsoid(semi_axes: [f64; 3], target: usize) -> Parts {
    let (mut vertices, faces) = geodesic(frequency(target));
    let axes = Vec3::from(semi_axes);
    for v in &mut vertices {
        *v = v.component_mul(&axes);
    }
    (vertices, faces)
}

/// The n ≥ 1 for which 20 n² is nearest to `target`.
fn frequency(target: usize) -> usize {
    let off = |n: usize| (20 * n * n).abs_diff(target.min(MAX_FACES));
    let near = ((target as f64 / 20.0).sqrt() as usize).max(1);
    if off(near + 1) < off(near) {
        near + 1
    } else {
        near
    }
}

/// A unit sphere of 20 n² faces. Powers of two halve the edges again and again and push the
/// middles out each time, which gives more even faces than pushing out a flat grid does.
fn geodesic(n: usize) -> Parts {
    let (mut vertices, mut faces) = icosahedron();
    if n.is_power_of_two() {
        for _ in 0..n.trailing_zeros() {
            (vertices, faces) = subdivide(&vertices, &faces, 2);
        }
        (vertices, faces)
    } else {
        subdivide(&vertices, &faces, n)
    }
}

/// The regular icosahedron whose mirror planes include x = 0, y = 0 and z = 0.
fn icosahedron() -> Parts {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::with_capacity(12);
    for axis in 0..3 {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let mut v = Vec3::zeros();
            v[(axis + 1) % 3] = s;
            v[(axis + 2) % 3] = t * golden;
            vertices.push(v.normalize());
        }
    }
    // Faces: all triples of neighbours. Neighbours are at the cosine 1/√5, all others below 0.
    let touch = |i: usize, j: usize| vertices[i].dot(&vertices[j]) > 0.0;
    let mut faces = Vec::with_capacity(20);
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if touch(i, j) && touch(j, k) && touch(k, i) {
                    let out = vertices[i].dot(&vertices[j].cross(&vertices[k])) > 0.0;
                    faces.push(if out { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    (vertices, faces)
}

/// Splits each face into n² and pushes the new vertices out to the unit sphere.
fn subdivide(coarse: &[Vec3], faces: &[[usize; 3]], n: usize) -> Parts {
    let mut vertices = coarse.to_vec();
    let mut fine = Vec::with_capacity(faces.len() * n * n);
    // A point is known by the corners of which it is a mix, with their weights out of n: points
    // on an edge come out the same from both faces.
    let mut known: HashMap<Vec<(usize, usize)>, usize> = HashMap::new();
    for corners in faces {
        let mut point = |i: usize, j: usize| -> usize {
            let mut mix: Vec<(usize, usize)> = corners
                .iter()
                .copied()
                .zip([n - i - j, i, j])
                .filter(|&(_, weight)| weight > 0)
                .collect();
            if let [(corner, _)] = mix.as_slice() {
                return *corner;
            }
            mix.sort_unstable();
            *known.entry(mix).or_insert_with_key(|mix| {
                let sum: Vec3 = mix.iter().map(|&(v, w)| coarse[v] * w as f64).sum();
                vertices.push(sum.normalize());
                vertices.len() - 1
            })
        };
        for i in 0..n {
            for j in 0..n - i {
                let [a, b, c] = [point(i, j), point(i + 1, j), point(i, j + 1)];
                fine.push([a, b, c]);
                if i + j + 2 <= n {
                    fine.push([b, point(i + 1, j + 1), c]);
                }
            }
        }
    }
    (vertices, fine)
}
