//! Bodies too large to factor: nothing of the size of a matrix, on either side.

use super::fixture::*;
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::boundary::{BodyBoundary, MfsSettings, Readout};
use hydrograd::coupling::full::{Cpu, Full, Model, Preconditioner, SolveSettings};
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise};
use hydrograd::gpu::full::Gpu;
use hydrograd::scene::Shape;
use hydrograd::shape;
use std::path::Path;
use std::sync::Arc;

fn bodies(factored: [bool; 3]) -> Vec<Arc<BodyBoundary>> {
    // Without the body's own residual flux both read the same potential out.
    let settings = MfsSettings {
        readout: Readout::Centre,
        ..MfsSettings::default()
    };
    let of = |k: usize, shape: &Shape| {
        let mesh = shape::build(shape, Path::new("."), Some(80)).unwrap();
        let made = if factored[k] {
            BodyBoundary::new("b", &mesh, &settings)
        } else {
            BodyBoundary::unfactored("b", &mesh, &settings)
        };
        Arc::new(made.unwrap())
    };
    vec![
        of(0, &Shape::sphere(0.5)),
        of(1, &Shape::ellipsoid([0.6, 0.3, 0.4])),
        of(2, &Shape::sphere(0.4)),
    ]
}

fn model(factored: [bool; 3], preconditioner: Preconditioner) -> Arc<Model> {
    let settings = SolveSettings {
        preconditioner,
        tolerance: 1e-9,
        ..SolveSettings::default()
    };
    Arc::new(Model::new(bodies(factored), &[], Exclusions::none(), settings).unwrap())
}

/// The impulses of some columns on the device against the CPU's, that has all factors.
fn compare(factored: [bool; 3], preconditioner: Preconditioner) {
    let basis = basis(3, 5, 0.3);
    let with = model([true; 3], preconditioner);
    let cpu = Full::on(with.clone(), Box::new(Cpu::new(with).unwrap()));
    let model = model(factored, preconditioner);
    let gpu = Full::on(
        model.clone(),
        Box::new(Gpu::new(context(), &model).unwrap()),
    );
    let a = cpu.evaluate(&poses(), &basis).unwrap();
    let b = gpu.evaluate(&poses(), &basis).unwrap();
    let found = difference(b.momenta().as_slice(), a.momenta().as_slice());
    assert!(found <= 1e-6, "{found:.1e}");
}

#[test]
fn bodies_without_factor_give_the_same_answer() {
    compare([false; 3], Preconditioner::Jacobi);
}

#[test]
fn bodies_with_and_without_factor_go_together() {
    compare([true, false, true], Preconditioner::Factors);
}

#[test]
fn sparse_factors_stand_for_others() {
    compare([false; 3], Preconditioner::Csd24);
    compare([true, false, true], Preconditioner::Csd24);
}

#[test]
fn the_cpu_refuses_a_body_without_factor() {
    let model = model([false; 3], Preconditioner::Jacobi);
    let message = Cpu::new(model).err().expect("refused").to_string();
    assert!(message.contains("backend gpu"), "{message}");
}

/// So many bodies in a cubic lattice with `n` along the edges of its layers, none like its neighbour in turn.
fn lattice(n: usize, count: usize) -> Vec<Pose> {
    let at = |k: usize| [k % n, k / n % n, k / (n * n)].map(|x| 1.5 * x as f64);
    (0..count)
        .map(|k| {
            let turn = Vec3::new(0.3 * k as f64, 1.0, 0.1 * (k * k) as f64);
            Pose::new(exp_matrix(&turn), Vec3::from(at(k)))
        })
        .collect()
}

#[test]
fn derivatives_of_many_pairs_go_in_batches() {
    let mesh = shape::build(&Shape::ellipsoid([0.5, 0.3, 0.4]), Path::new("."), Some(20)).unwrap();
    let boundary = BodyBoundary::new("b", &mesh, &MfsSettings::default()).unwrap();
    let body = Arc::new(boundary);
    let poses = lattice(4, 47);
    let settings = SolveSettings {
        tolerance: 1e-10,
        ..SolveSettings::default()
    };
    let model = Model::new(vec![body; poses.len()], &[], Exclusions::none(), settings);
    let model = Arc::new(model.unwrap());
    let (cpu, gpu) = both(context(), &model);
    // 2162 pairs, 720 and 384 bytes each: more than the device is asked to hold of them at once (2048 pairs, or 1 MiB).
    let basis = basis(poses.len(), 5, 0.3);
    let (x, y) = (twist(1, 0.1).rows(0, 5).into_owned(), twist(1, 0.9));
    let y = y.rows(0, 5).into_owned();
    let z = displacement(poses.len(), 0.7);
    let of = |full: &Full| {
        let record = full.linearise(&poses, &basis).unwrap();
        let columns = record.gradient_columns(&x).unwrap().concat();
        let tangent = record
            .hvp(Direction::Basis(&x), Direction::Basis(&y), &z)
            .unwrap();
        (flat(&columns), flat(&tangent.wrench))
    };
    let (on_gpu, on_cpu) = (of(&gpu), of(&cpu));
    let found = difference(&on_gpu.0, &on_cpu.0);
    assert!(found <= 1e-7, "{found:.1e}");
    let found = difference(&on_gpu.1, &on_cpu.1);
    assert!(found <= 1e-7, "{found:.1e}");
}
