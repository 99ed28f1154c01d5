//! Gaps of shapes by formula: against closed forms, other ways to find them, and dense meshes.

mod cylinders;
mod known;
mod meshes;

use crate::support::directions;
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::geometry::{Gap, Gaps, Other, Wall};
use hydrograd::shape::{build, solid};
use hydrograd::{Shape, TriMesh};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use std::path::Path;

fn mesh(shape: &Shape, faces: usize) -> TriMesh {
    build(shape, Path::new(""), Some(faces)).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    turned([0.0; 3], [x, y, z])
}

fn turned(w: [f64; 3], x: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(w)), Vec3::from(x))
}

fn vector(random: &mut Samples) -> Vec3 {
    Vec3::from(random.vector(1.0))
}

fn pose(random: &mut Samples, spread: f64) -> Pose {
    let turn = 3.0 * vector(random);
    Pose::new(exp_matrix(&turn), spread * vector(random))
}

/// Of coarse meshes, which don't matter.
fn by_formula(shapes: &[&Shape], walls: &[Wall]) -> Gaps {
    let meshes: Vec<TriMesh> = shapes.iter().map(|s| mesh(s, 80)).collect();
    let meshes: Vec<_> = meshes.iter().map(Some).collect();
    let solids = shapes.iter().map(|s| solid(s, Pose::identity()).unwrap());
    let gaps = Gaps::new(&meshes, walls, &[]).unwrap();
    gaps.by_formula(solids.collect()).unwrap()
}

/// The gap of two shapes, which must be the same whoever comes first, wherever the two are carried
/// together, and at every size.
fn gap(a: &Shape, at_a: Pose, b: &Shape, at_b: Pose) -> f64 {
    let there = by_formula(&[a, b], &[]);
    let found = there.smallest(&[at_a, at_b]).unwrap();
    assert_eq!(there.all(&[at_a, at_b]), [found]);
    let d = found.distance;
    let size = mesh(a, 80).diameter() + mesh(b, 80).diameter();
    let back = by_formula(&[b, a], &[]).smallest(&[at_b, at_a]).unwrap();
    let carry = turned([0.4, -1.3, 2.2], [0.3 * size, -size, 0.7 * size]);
    let carried = [carry.compose(&at_a), carry.compose(&at_b)];
    let carried = there.smallest(&carried).unwrap();
    // Where they overlap the shift is looked for, and found to this.
    let within = if d < 0.0 { 0.02 } else { 1e-11 };
    for other in [back.distance, carried.distance] {
        assert!(
            (other - d).abs() < within * d.abs() + 1e-13 * size,
            "{a:?} {b:?}: {d:e} {other:e}"
        );
    }
    d
}

fn wall_gap(shape: &Shape, pose: Pose, wall: Wall) -> Gap {
    let found = by_formula(&[shape], &[wall]).smallest(&[pose]).unwrap();
    assert_eq!((found.first, found.second), (0, Other::Wall(0)));
    found
}

/// Relative to the gap, of bodies about one in size.
fn check(found: f64, exact: f64, within: f64) {
    assert!(
        (found - exact).abs() <= within * exact.abs() + 1e-15,
        "{found:e} {exact:e}"
    );
}
