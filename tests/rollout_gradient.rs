//! Gradients of whole rollouts against central differences: every integrator, both fidelities,
//! every kind of joint.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::Scene;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Fidelity, Settings, Simulator};
use std::path::Path;

const INTEGRATORS: [Integrator; 5] = [
    Integrator::MomentumEuler,
    Integrator::Midpoint,
    Integrator::Rk2,
    Integrator::Rk4,
    Integrator::VelocityEuler,
];

fn check(scene: &Scene, fidelity: Fidelity, integrator: Integrator, steps: usize, faces: usize) {
    // Long rollouts along one direction of each group, short ones along two.
    let directions = if steps > 50 { 1 } else { 2 };
    let settings = Settings::for_scene(scene)
        .fidelity(fidelity)
        .integrator(integrator)
        .tolerance(1e-13)
        .faces(faces);
    let mut simulator = Simulator::new(scene, settings).unwrap();
    let report = gradcheck(
        &mut simulator,
        &gradcheck::Settings {
            steps,
            directions,
            seed: 7,
            timings: 0,
        },
    )
    .unwrap();
    println!(
        "{} {fidelity:?} {integrator:?} {steps}: {:.1e}",
        scene.name, report.max_rel_error
    );
    assert!(
        report.max_rel_error <= 1e-6,
        "{} {fidelity:?} {integrator:?}: {:#?}",
        scene.name,
        report.directions
    );
}

fn scene(name: &str) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    Scene::load(folder.join(format!("{name}.toml"))).unwrap()
}

#[test]
fn kirchhoff_ellipsoid() {
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Isolated, Fidelity::Full] {
            check(&scene("kirchhoff_ellipsoid"), fidelity, integrator, 10, 80);
        }
    }
}

#[test]
fn coins() {
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Isolated, Fidelity::Full] {
            check(&scene("coins"), fidelity, integrator, 8, 80);
        }
    }
}

#[test]
fn falling_ball() {
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Isolated, Fidelity::Full] {
            check(&scene("falling_ball"), fidelity, integrator, 20, 80);
        }
    }
}

#[test]
fn falling_ball_for_a_hundred_steps() {
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Isolated, Fidelity::Full] {
            check(&scene("falling_ball"), fidelity, integrator, 100, 20);
        }
    }
}
