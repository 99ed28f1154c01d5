//! What rests in water that bodies feel each other through: it doesn't move, and so the water does nothing to it.

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

fn simulator(scene: &Scene) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    Simulator::new(scene, settings.integrator(Integrator::MomentumEuler)).unwrap()
}

/// What the floor presses in the last step, over the weight in the water.
fn pressed(rollout: &Rollout, weight: f64) -> f64 {
    let forces = rollout.contacts(rollout.steps() - 1, 0.0).unwrap();
    forces.iter().map(|c| c.force[2]).sum::<f64>() / weight
}

#[test]
fn what_rests_presses_by_its_weight() {
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
            let simulator = simulator(&scene);
            let rollout = run(&simulator, steps);
            let volume = simulator.parameters().volume(0);
            let weight = (density - 1000.0) * volume * GRAVITY;
            let (share, v) = (pressed(&rollout, weight), rollout.samples()[steps].v.amax());
            println!("{name}, {dt} s: presses by {share:.6} of its weight, reads {v:.1e}");
            assert!((share - 1.0).abs() < 2e-3, "{name}, {dt}: {share}");
            assert!(v < 2e-2 * GRAVITY * dt, "{name}, {dt}: {v}");
        }
    }
}

/// Two balls at rest side by side on a floor without friction stay where they are.
#[test]
fn what_rests_side_by_side_stays() {
    for dt in [0.02, 0.01, 0.005] {
        let mut scene = floor(dt, 0.0);
        for x in [0.0, 0.205] {
            let ball = Body::new(Shape::sphere(0.1)).density(3000.0);
            scene.add(ball.at([x, 0.0, 0.101]));
        }
        let steps = (0.6 / dt).round() as usize;
        let rollout = run(&simulator(&scene), steps);
        let along = |k: usize| [0, 6].map(|i| rollout.samples()[k].v[i].abs());
        let found = along(steps).into_iter().fold(0.0, f64::max);
        println!(
            "{dt} s: {found:.1e} m/s after 0.6 s, {:.1e} after 0.3",
            along(steps / 2)[0]
        );
        assert!(found < 2e-4, "{dt}: {found}");
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
    let mut simulator = simulator(&scene);
    let rollout = run(&simulator, 8);
    assert!((0..8).all(|n| !rollout.contacts(n, 0.0).unwrap().is_empty()));
    check_gradient("two balls on a floor", &mut simulator, 8, 3, 1e-6);
}
