//! What tests and benches share. Each of them uses a part of it.
#![allow(dead_code)]

pub mod bodies;
#[cfg(feature = "cli")]
pub mod command;
pub mod falling;
pub mod forward;
pub mod grasps;
pub mod heap;
pub mod reference;

use hydrograd::adjoint::lie::Vec3;
use hydrograd::dynamics::Integrator;
use hydrograd::shape::{self, TriMesh};
use hydrograd::simulate::gradcheck;
use hydrograd::{Controls, Fidelity, Rollout, Scene, Settings, Shape, Simulator};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

/// Acceleration of gravity, m/s².
pub const GRAVITY: f64 = 9.81;

pub const INTEGRATORS: [Integrator; 6] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
    Integrator::Rk2,
    Integrator::Rk4,
    Integrator::VelocityEuler,
];

/// Those that solve contact and joint limits.
pub const CONTACT_INTEGRATORS: [Integrator; 4] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
    Integrator::VelocityEuler,
];

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// File of an example scene.
pub fn example_path(name: &str) -> PathBuf {
    root().join(format!("examples/scenes/{name}.toml"))
}

pub fn example(name: &str) -> Scene {
    Scene::load(example_path(name)).unwrap()
}

/// Default settings but for these two.
pub fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(integrator);
    Simulator::new(scene, settings).unwrap()
}

/// A rollout without control, all of whose states are finite.
pub fn run(simulator: &Simulator, steps: usize) -> Rollout {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    for sample in rollout.samples() {
        assert!(sample.q.iter().chain(&sample.v).all(|x| x.is_finite()));
    }
    rollout
}

/// Holds the gradient of a rollout against differences along `directions` in each group of variables, and forward mode against it.
#[track_caller]
pub fn check_gradient(
    what: &str,
    simulator: &mut Simulator,
    steps: usize,
    directions: usize,
    limit: f64,
) {
    let settings = gradcheck::GradcheckSettings {
        steps,
        directions,
        seed: 3,
        timings: 0,
        enough: Some(limit),
    };
    let report = gradcheck::gradcheck(simulator, &settings).unwrap();
    println!("{what}: {:.1e}", report.max_rel_error);
    forward::check_forward(what, simulator, steps, forward::LIMIT);
    assert!(
        report.max_rel_error <= limit,
        "{what}: {:#?}",
        report.directions
    );
}

/// The message has all of these words.
#[track_caller]
pub fn says(message: impl ToString, words: &[&str]) {
    let message = message.to_string();
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
}

/// A shape's mesh of about this many faces.
pub fn mesh(shape: &Shape, faces: usize) -> TriMesh {
    shape::build(shape, Path::new("."), Some(faces)).unwrap()
}

/// max |ΔM_ij| / √(M_ii M_jj), the reference's diagonal, which must not vanish.
pub fn scaled_error(m: &DMatrix<f64>, reference: &DMatrix<f64>) -> f64 {
    assert_eq!(m.shape(), reference.shape());
    let mut worst = 0.0_f64;
    for i in 0..m.nrows() {
        for j in 0..m.ncols() {
            let scale = (reference[(i, i)] * reference[(j, j)]).sqrt();
            assert!(scale > 0.0, "diagonal {i} {j} of the reference");
            worst = worst.max((m[(i, j)] - reference[(i, j)]).abs() / scale);
        }
    }
    worst
}

/// max |ΔM_ij| / √(M_ii M_jj), but for directions in which next to no water moves: a round body's spin.
pub fn felt_error(found: &DMatrix<f64>, exact: &DMatrix<f64>) -> f64 {
    let most = [0, 3].map(|k| {
        let own = (0..exact.nrows()).filter(|i| i % 6 / 3 == k / 3);
        own.map(|i| exact[(i, i)]).fold(0.0, f64::max)
    });
    let felt = |i: &usize| exact[(*i, *i)] > 1e-3 * most[i % 6 / 3];
    let felt: Vec<usize> = (0..exact.nrows()).filter(felt).collect();
    let off = |i: usize, j: usize| {
        let size = (exact[(i, i)] * exact[(j, j)]).sqrt();
        (found[(i, j)] - exact[(i, j)]).abs() / size
    };
    let all = felt.iter().flat_map(|i| felt.iter().map(|j| off(*i, *j)));
    all.fold(0.0, f64::max)
}

/// Unit vectors spread evenly over the sphere.
pub fn directions(count: usize) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sine, cosine) = (golden * i as f64).sin_cos();
        let width = (1.0 - z * z).sqrt();
        Vec3::new(width * cosine, width * sine, z)
    };
    (0..count).map(direction).collect()
}

/// Files of example scenes; those with robots where such can be read.
pub fn example_scenes() -> Vec<std::path::PathBuf> {
    let listed = std::fs::read_dir(root().join("examples/scenes")).unwrap();
    let paths = listed.map(|entry| entry.unwrap().path());
    let scenes = paths.filter(|path| path.extension().is_some_and(|e| e == "toml"));
    let read = |path: &std::path::PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        cfg!(feature = "urdf") || !text.contains("[[robot]]")
    };
    scenes.filter(read).collect()
}
