//! What rests doesn't move, and so no force of its motion is on it: the water's, or its links' own.

use crate::support::{check_gradient, run};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Fluid, Scene, Shape};
use hydrograd::{Fidelity, Rollout, Settings, Simulator};

const GRAVITY: f64 = 9.81;

fn floor(dt: f64, friction: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1000.0,
        ..Fluid::fresh_water()
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.time_step = dt;
    scene.contact = Some(Contact {
        friction,
        ..Contact::default()
    });
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene
}

const INTEGRATORS: [Integrator; 3] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
];

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// What the floor presses in the last step, over the weight in the water.
fn pressed(rollout: &Rollout, weight: f64) -> f64 {
    let forces = rollout.contacts(rollout.steps() - 1, 0.0).unwrap();
    forces.iter().map(|c| c.force[2]).sum::<f64>() / weight
}

#[test]
fn what_rests_presses_by_its_weight() {
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Reduced, Fidelity::Isolated] {
            presses_by_its_weight(fidelity, integrator);
        }
    }
}

fn presses_by_its_weight(fidelity: Fidelity, integrator: Integrator) {
    for (name, shape, height, density) in [
        ("ball", Shape::sphere(0.1), 0.101, 3000.0),
        ("small ball", Shape::sphere(0.02), 0.0203, 7800.0),
        (
            "block",
            Shape::cuboid([0.1, 0.1, 0.05]).faces(320),
            0.0255,
            7800.0,
        ),
    ] {
        for (dt, steps) in [(0.02, 40), (0.01, 80), (0.005, 120)] {
            let mut scene = floor(dt, 0.5);
            scene.add(
                Body::new(shape.clone())
                    .density(density)
                    .at([0.0, 0.0, height]),
            );
            let simulator = simulator(&scene, fidelity, integrator);
            let rollout = run(&simulator, steps);
            let volume = simulator.parameters().volume(0);
            let weight = (density - 1000.0) * volume * GRAVITY;
            let (share, v) = (pressed(&rollout, weight), rollout.samples()[steps].v.amax());
            println!(
                "{name}, {fidelity:?}, {integrator:?}, {dt} s: presses by {share:.6} of its weight, reads {v:.1e}"
            );
            let at = format!("{name}, {fidelity:?}, {integrator:?}, {dt}");
            let bound = match (fidelity, integrator) {
                // The energy of what the water does all the same is closed.
                (Fidelity::Reduced, Integrator::EnergyEuler) => 4e-3,
                _ => 1e-9,
            };
            assert!((share - 1.0).abs() < bound, "{at}: {share}");
            assert!(v < 2e-2 * GRAVITY * dt, "{at}: {v}");
        }
    }
}

/// Two balls at rest side by side on a floor without friction stay where they are.
#[test]
fn what_rests_side_by_side_stays() {
    for integrator in INTEGRATORS {
        side_by_side(integrator);
    }
}

fn side_by_side(integrator: Integrator) {
    for dt in [0.02, 0.01, 0.005] {
        let mut scene = floor(dt, 0.0);
        for x in [0.0, 0.205] {
            let ball = Body::new(Shape::sphere(0.1)).density(3000.0);
            scene.add(ball.at([x, 0.0, 0.101]));
        }
        let steps = (0.6 / dt).round() as usize;
        let rollout = run(&simulator(&scene, Fidelity::Reduced, integrator), steps);
        let along = |k: usize| [0, 6].map(|i| rollout.samples()[k].v[i].abs());
        let found = along(steps).into_iter().fold(0.0, f64::max);
        println!(
            "{integrator:?}, {dt} s: {found:.1e} m/s after 0.6 s, {:.1e} after 0.3",
            along(steps / 2)[0]
        );
        assert!(found < 2e-4, "{integrator:?}, {dt}: {found}");
    }
}

/// A ball that slides on the floor past another one.
#[test]
fn gradients_are_those_of_the_steps() {
    let mut scene = floor(0.01, 0.3);
    for (x, y) in [(0.0, 0.0), (0.23, 0.05)] {
        let ball = Body::new(Shape::sphere(0.1).faces(80)).density(1500.0);
        scene.add(ball.at([x, y, 0.1005]));
    }
    scene.initial.v = vec![
        0.4, 0.1, -0.1, 0.0, 0.5, 0.0, 0.0, 0.05, -0.05, 0.2, 0.0, 0.1,
    ];
    for integrator in INTEGRATORS {
        for fidelity in [Fidelity::Reduced, Fidelity::Isolated] {
            let mut simulator = simulator(&scene, fidelity, integrator);
            let rollout = run(&simulator, 8);
            let presses = |n: &usize| !rollout.contacts(*n, 0.0).unwrap().is_empty();
            let pressed = (0..8).filter(presses).count();
            assert!(pressed >= 6, "{fidelity:?}, {integrator:?}: {pressed}");
            let name = format!("two balls on a floor, {fidelity:?}, {integrator:?}");
            check_gradient(&name, &mut simulator, 8, 3, 1e-6);
        }
    }
}
