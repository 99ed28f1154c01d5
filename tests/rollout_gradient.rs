//! Gradients of whole rollouts against central differences: every integrator, both fidelities,
//! every kind of joint.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{BodyId, Scene};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DVector;
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

/// Objectives that don't fit the scene are refused by name, and those that do agree with differences.
#[test]
fn objectives_are_checked_and_differentiated() {
    let settings = Settings::default().faces(80).tolerance(1e-13);
    let mut simulator = Simulator::new(&scene("coins"), settings).unwrap();
    let controls = Controls::zeros(&simulator, 5);
    let body = BodyId(1);
    let goal = objective::final_position(body, [0.1, 0.0, 0.2])
        + objective::mean_position(body, [0.0, 0.1, 0.0])
        + objective::final_coordinate(2, 0.3, 1e-3)
        + objective::final_velocity(5, 0.1, 1e-3);
    let gradient = simulator
        .rollout(&controls)
        .unwrap()
        .gradient(&goal)
        .unwrap();
    let (q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
    let d = DVector::from_fn(6, |i, _| (i as f64 + 1.0).sin() * 1e-2);
    let mut at = |h: f64| {
        simulator.set_start(&q + h * &d, v.clone()).unwrap();
        simulator.rollout(&controls).unwrap().value(&goal).unwrap()
    };
    let difference = (8.0 * (at(0.1) - at(-0.1)) - (at(0.2) - at(-0.2))) / 1.2;
    let adjoint = gradient.initial.q.dot(&d);
    assert!(
        (difference - adjoint).abs() < 1e-7 * adjoint.abs(),
        "{difference} {adjoint}"
    );
    let rollout = simulator.rollout(&controls).unwrap();
    let wrong = [
        (objective::final_position(BodyId(7), [0.0; 3]), "body"),
        (objective::final_velocity(6, 0.0, 1.0), "velocity"),
        (objective::final_coordinate(9, 0.0, 1.0), "coordinate"),
        (objective::effort(f64::NAN), "finite"),
    ];
    for (objective, word) in wrong {
        let message = rollout.gradient(&objective).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
        assert!(rollout.value(&objective).is_err());
    }
}
