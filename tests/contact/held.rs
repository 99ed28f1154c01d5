//! Flat surfaces that press on one another in coupled water: what holds them is at rest, though it would move by many times the gap if nothing bore it.

use crate::support::{check_gradient, run};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Controller, Fluid, Joint, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};

const INTEGRATORS: [Integrator; 2] = [Integrator::MomentumEuler, Integrator::Midpoint];
/// Two flat fingers on rails, pushed by `push` (N), a little off a block between them. They are smaller than its sides: where edges lie on edges what touches has a kink.
fn grip(dt: f64, push: f64, density: f64) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = dt;
    scene.contact = Some(Contact {
        friction: 0.6,
        ..Contact::default()
    });
    for (name, side) in [("left", -1.0), ("right", 1.0)] {
        let finger = Body::new(Shape::cuboid([0.02, 0.05, 0.045]).faces(320)).density(2700.0);
        let rail = Joint::Prismatic {
            axis: [-side, 0.0, 0.0],
        };
        let finger = finger.at([side * 0.0505, 0.0, 0.0]).joint(rail);
        scene.add(finger.named(name).actuated());
    }
    let block = Body::new(Shape::cuboid([0.08, 0.06, 0.06]).faces(320)).density(density);
    scene.add(block.named("block"));
    scene.controller = Some(Controller::Constant {
        control: vec![push; 2],
    });
    scene
}

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// Fingers that hold a block move no more than rounding, read as that, press by what they are pushed with, and no step of it is cut.
#[test]
fn a_flat_grip_is_at_rest() {
    for integrator in INTEGRATORS {
        for (dt, push) in [(0.02, 10.0), (0.01, 40.0), (0.005, 100.0)] {
            let scene = grip(dt, push, 998.0);
            let steps = (1.0 / dt) as usize;
            let rollout = run(&simulator(&scene, integrator), steps);
            let summary = rollout.summary();
            let fastest = rollout.samples()[steps].v.amax();
            let forces = rollout.contacts(steps - 1, 0.0).unwrap();
            let pressed = forces.iter().map(|c| c.force[0].abs()).sum::<f64>() / (2.0 * push);
            println!(
                "{integrator:?}, {dt} s, {push} N: {} of {steps} steps cut, {fastest:.1e} m/s at the end, pressed by {pressed:.12}",
                summary.cut_steps
            );
            assert!(summary.cut_steps <= 2, "{integrator:?}, {dt}");
            assert!(fastest < 1e-8, "{integrator:?}, {dt}: {fastest:.1e}");
            assert!(
                (pressed - 1.0).abs() < 1e-6,
                "{integrator:?}, {dt}: {pressed}"
            );
        }
    }
}

/// A block that is heavier than the water and comes in moving, held by friction against its weight.
#[test]
fn gradients_are_those_of_the_steps() {
    let mut scene = grip(0.01, 40.0, 2000.0);
    scene.gravity = [0.0, 0.0, -9.81];
    scene.initial.v = vec![0.02, 0.01, 0.01, -0.02, 0.05, 0.1, 0.2, 0.1];
    for integrator in INTEGRATORS {
        let mut simulator = simulator(&scene, integrator);
        let rollout = run(&simulator, 10);
        let presses = |n: &usize| !rollout.contacts(*n, 0.0).unwrap().is_empty();
        let pressed = (0..10).filter(presses).count();
        assert!(pressed >= 6, "{integrator:?}: {pressed}");
        let name = format!("a flat grip, {integrator:?}");
        check_gradient(&name, &mut simulator, 10, 3, 1e-6);
    }
}
