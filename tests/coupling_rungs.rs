//! The rungs of the coupled system against central differences, with walls and without.

use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::{BodyBoundary, Method, Settings};
use hydrograd::coupling::full::{Full, SolveSettings, Solver, WetBody};
use hydrograd::coupling::{Coupling, Direction};
use hydrograd::scene::{Shape, Wall};
use hydrograd::shape;
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use std::sync::Arc;

fn body(shape: Shape, faces: usize, method: Method, damping: f64) -> Arc<WetBody> {
    let mesh = shape::build(&shape, Path::new("."), Some(faces)).unwrap();
    let settings = Settings {
        method,
        damping,
        ..Settings::default()
    };
    let b = BodyBoundary::new("b", mesh.vertices(), mesh.faces(), &settings).unwrap();
    Arc::new(WetBody::new(mesh.vertices(), mesh.faces(), Arc::new(b)).unwrap())
}

fn full(method: Method, solver: Solver, walls: &[Wall]) -> Full {
    // GMRES takes the square system as it is.
    let damping = match solver {
        Solver::Gmres => 0.0,
        _ => Settings::default().damping,
    };
    let bodies = vec![
        body(Shape::sphere(0.5), 80, method, damping),
        body(Shape::ellipsoid([0.6, 0.3, 0.4]), 80, method, damping),
    ];
    let settings = SolveSettings {
        solver,
        tolerance: 1e-13,
        ..SolveSettings::default()
    };
    Full::new(bodies, walls, settings).unwrap()
}

fn poses() -> Vec<Pose> {
    vec![
        Pose::new(
            exp_matrix(&Vec3::new(0.2, -0.4, 0.3)),
            Vec3::new(0.1, -0.2, 1.0),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(-0.7, 0.5, 0.9)),
            Vec3::new(0.5, 0.9, 0.9),
        ),
    ]
}

fn displaced(z: &[Vec6], h: f64) -> Vec<Pose> {
    poses()
        .iter()
        .zip(z)
        .map(|(p, z)| p.displace(&(h * z)))
        .collect()
}

fn wavy(n: usize, phase: f64) -> Vec<f64> {
    (0..n).map(|i| (1.7 * i as f64 + phase).sin()).collect()
}

fn field(phase: f64) -> Vec<Vec6> {
    wavy(12, phase)
        .chunks(6)
        .map(Vec6::from_row_slice)
        .collect()
}

fn dot(a: &[Vec6], b: &[Vec6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn relative(a: f64, b: f64) -> f64 {
    (a - b).abs() / b.abs().max(1e-3)
}

fn check(coupling: &Full, tolerance: f64) {
    let basis = DMatrix::from_vec(12, 3, wavy(36, 0.4));
    let twist = DVector::from_vec(wavy(12, 2.2));
    let (cx, cy) = (
        DVector::from_vec(wavy(3, 0.1)),
        DVector::from_vec(wavy(3, 1.1)),
    );
    let (z, y_field) = (field(0.7), field(1.9));
    let energy = |poses: &[Pose], x: &DVector<f64>, y: &DVector<f64>| {
        let b = DMatrix::from_columns(&[x.clone(), y.clone()]);
        let r = coupling.evaluate(poses, &b, false).unwrap();
        let m = b.tr_mul(r.momenta());
        0.5 * (m[(0, 1)] + m[(1, 0)])
    };
    let record = coupling.evaluate(&poses(), &basis, true).unwrap();
    let (x, y) = (&basis * &cx, &basis * &cy);
    let h = 1e-3;
    // vjp on the basis, and along; differences of fourth order.
    let difference = |x: &DVector<f64>, y: &DVector<f64>| {
        let d = |h: f64| energy(&displaced(&z, h), x, y) - energy(&displaced(&z, -h), x, y);
        (8.0 * d(h) - d(2.0 * h)) / (12.0 * h)
    };
    let gradient = dot(&record.gradient(&cx, &cy), &z);
    assert!(
        relative(gradient, difference(&x, &y)) < tolerance,
        "gradient {gradient}"
    );
    assert!(relative(record.gradient_along(&cy, &z).dot(&cx), gradient) < 1e-10);
    // vjp for a direction outside the basis, and the impulses.
    let pull = record
        .vjp(Direction::Twist(&twist), Direction::Basis(&cy))
        .unwrap();
    let value = dot(&pull.wrench, &z);
    assert!(
        relative(value, difference(&twist, &y)) < tolerance,
        "vjp {value}"
    );
    assert!(relative(pull.momentum_x.dot(&y), energy(&poses(), &twist, &y)) < 1e-10);
    assert!(relative(pull.momentum_y.dot(&twist), energy(&poses(), &twist, &y)) < 1e-10);
    // hvp: tangents of impulses and wrenches.
    let at = |s: f64| coupling.evaluate(&displaced(&z, s), &basis, true).unwrap();
    let records = [at(h), at(-h), at(2.0 * h), at(-2.0 * h)];
    let weights = [8.0, -8.0, -1.0, 1.0].map(|w| w / (12.0 * h));
    let rate = |c: &DVector<f64>| {
        let terms = records.iter().zip(weights);
        terms.fold(DVector::zeros(12), |sum, (r, w)| {
            sum + w * (r.momenta() * c)
        })
    };
    for (a, b) in [(&cx, &cy), (&cx, &cx)] {
        let t = record
            .hvp(Direction::Basis(a), Direction::Basis(b), &z)
            .unwrap();
        let dm = rate(a);
        assert!(
            (&t.momentum_x - &dm).norm() < tolerance * dm.norm(),
            "momentum tangent"
        );
        let dm = rate(b);
        assert!(
            (&t.momentum_y - &dm).norm() < tolerance * dm.norm(),
            "momentum tangent y"
        );
        let g = record.gradient(a, b);
        let size = dot(&g, &g).sqrt();
        for k in 0..2 {
            let terms = records.iter().zip(weights);
            let d = terms.fold(Vec6::zeros(), |sum, (r, w)| sum + w * r.gradient(a, b)[k]);
            assert!(
                (t.wrench[k] - d).norm() < tolerance * size,
                "{} vs {d}",
                t.wrench[k]
            );
        }
        // The order of two displacements matters by their bracket.
        let other = record
            .hvp(Direction::Basis(a), Direction::Basis(b), &y_field)
            .unwrap();
        let bracket: f64 = (0..2)
            .map(|k| g[k].dot(&hydrograd::adjoint::lie::cross_motion(&z[k], &y_field[k])))
            .sum();
        let (yz, zy) = (dot(&other.wrench, &z), dot(&t.wrench, &y_field));
        assert!(relative(yz, zy + bracket) < 1e-9, "{yz} {zy} {bracket}");
    }
}

const WALL: Wall = Wall {
    point: [0.0, 0.0, 0.1],
    normal: [0.1, 0.0, 1.0],
};
const SIDE: Wall = Wall {
    point: [-0.8, 0.0, 0.0],
    normal: [1.0, 0.0, -0.1],
};

#[test]
fn vertex_sources_without_walls() {
    check(&full(Method::MfsVertex, Solver::Cgls, &[]), 1e-6);
}

#[test]
fn vertex_sources_dense_between_two_walls() {
    check(&full(Method::MfsVertex, Solver::Qr, &[WALL, SIDE]), 1e-6);
}

#[test]
fn face_sources_normal_equations_by_a_wall() {
    check(&full(Method::MfsFace, Solver::Cgls, &[WALL]), 1e-6);
}

#[test]
fn face_sources_gmres() {
    check(&full(Method::MfsFace, Solver::Gmres, &[]), 1e-6);
}
