//! Triangles and the tree over them against slow ways.

use super::triangle::Triangle;
use super::{Gaps, TriMesh};
use hydrograd_adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd_adjoint::sample::Samples;

fn vector(random: &mut Samples) -> Vec3 {
    Vec3::from(random.vector(1.0))
}

fn corners(random: &mut Samples) -> [Vec3; 3] {
    [(); 3].map(|()| vector(random))
}

pub(super) fn turned(w: [f64; 3], x: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(w)), Vec3::from(x))
}

/// 192 faces.
pub(super) fn cuboid(size: [f64; 3]) -> TriMesh {
    let corner = |k: usize| Vec3::from_fn(|i, _| size[i] * (((k >> i) & 1) as f64 - 0.5));
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let mesh = TriMesh::new("box", (0..8).map(corner).collect(), faces.collect()).unwrap();
    mesh.split().split()
}

/// The unit ball: a cube's faces on it.
pub(super) fn ball() -> TriMesh {
    let cube = cuboid([1.0; 3]);
    let vertices = cube.vertices().iter().map(|x| x.normalize()).collect();
    TriMesh::new("ball", vertices, cube.faces().to_vec()).unwrap()
}

#[test]
fn triangles_against_alternating_projections() {
    let mut random = Samples::new(7);
    let mut disjoint = 0;
    for _ in 0..300 {
        let shift = vector(&mut random) * 2.0;
        let a = Triangle::new(corners(&mut random));
        let b = Triangle::new(corners(&mut random).map(|x| x + shift));
        let found = a.distance_squared(&b, f64::INFINITY).unwrap().sqrt();
        let mut p = a.corners[0];
        let mut q = p;
        for _ in 0..20_000 {
            q = b.closest(&p).0;
            p = a.closest(&q).0;
        }
        let expected = (p - q).norm();
        assert!(found <= expected + 1e-15, "{found} {expected}");
        if found > 0.0 {
            disjoint += 1;
            assert!(found > expected * (1.0 - 1e-6) - 1e-3, "{found} {expected}");
        }
    }
    assert!(disjoint > 100);
}

#[test]
fn closest_point_of_a_triangle_is_no_farther_than_any_other() {
    let mut random = Samples::new(3);
    for _ in 0..200 {
        let t = Triangle::new(corners(&mut random));
        let p = vector(&mut random) * 2.0;
        let (closest, _) = t.closest(&p);
        let [a, b, c] = t.corners;
        for i in 0..=20 {
            for j in 0..=(20 - i) {
                let (u, v) = (i as f64 / 20.0, j as f64 / 20.0);
                let x = a + (b - a) * u + (c - a) * v;
                assert!((p - closest).norm() <= (p - x).norm() + 1e-14);
            }
        }
    }
}

#[test]
fn the_tree_finds_what_all_pairs_of_faces_give() {
    let mut random = Samples::new(11);
    let (a, b) = (ball(), cuboid([1.0, 0.2, 0.6]));
    for _ in 0..20 {
        let (pose_a, pose_b) = (turned(random.vector(1.0), [0.0; 3]), {
            let x = vector(&mut random).normalize() * (2.0 + 0.4 * random.number());
            turned((vector(&mut random) * 2.0).into(), x.into())
        });
        let (placed_a, placed_b) = (a.transformed(&pose_a), b.transformed(&pose_b));
        let mut least = f64::INFINITY;
        for f in 0..placed_a.faces().len() {
            let here = Triangle::new(placed_a.corners(f));
            for g in 0..placed_b.faces().len() {
                let there = Triangle::new(placed_b.corners(g));
                least = here.distance_squared(&there, least).unwrap_or(least);
            }
        }
        let gaps = Gaps::new(&[Some(&a), Some(&b)], &[], &[]).unwrap();
        let found = gaps.smallest(&[pose_a, pose_b]).unwrap().distance;
        let expected = least.sqrt();
        assert!(
            (found - expected).abs() < 1e-11 * expected,
            "{found} {expected}"
        );
    }
}
