//! Rollouts through closing gaps with films: their gradients, and what keeps them apart.

use crate::support::check_gradient;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::{Controls, Fidelity, Settings, Simulator};

fn settings(integrator: Integrator) -> Settings {
    Settings::default()
        .fidelity(Fidelity::Reduced)
        .integrator(integrator)
}

/// A tilted block that sinks on a floor, and an egg that comes at it from above.
fn closing() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let block = Body::new(Shape::cuboid([0.3, 0.25, 0.1]).faces(320)).density(1500.0);
    let block = block.named("block").joint(Joint::Free).actuated();
    scene.add(block.at([0.0, 0.0, 0.075]).rotated([0.03, -0.05, 0.2]));
    let egg = Body::new(Shape::ellipsoid([0.1, 0.08, 0.06]).faces(320)).density(1200.0);
    let egg = egg.named("egg").joint(Joint::Free);
    scene.add(egg.at([0.03, 0.01, 0.21]).rotated([0.2, 0.1, 0.0]));
    scene.time_step = 0.01;
    scene.initial.v = vec![0.0; 12];
    scene.initial.v[2] = -0.1;
    scene.initial.v[8] = -0.3;
    scene
}

/// Against differences, through films on both sides of the block, by compressed bodies and by panels.
#[test]
fn gradients_through_films() {
    for (integrator, fidelity) in [
        (Integrator::MomentumEuler, Fidelity::Reduced),
        (Integrator::Rk2, Fidelity::Reduced),
        (Integrator::Rk2, Fidelity::Full),
    ] {
        let scene = closing();
        let settings = |integrator| {
            let settings = settings(integrator).fidelity(fidelity).tolerance(1e-13);
            if fidelity == Fidelity::Full {
                settings.faces(80)
            } else {
                settings
            }
        };
        let mut simulator = Simulator::new(&scene, settings(integrator)).unwrap();
        let run = |settings: Settings| {
            let simulator = Simulator::new(&scene, settings).unwrap();
            let rollout = simulator.rollout(&Controls::zeros(&simulator, 6)).unwrap();
            rollout.samples().last().unwrap().v.clone()
        };
        let there = (run(settings(integrator)) - run(settings(integrator).films(false))).amax();
        assert!(there > 1e-3, "no film: {there:e}");
        check_gradient("through films", &mut simulator, 6, 3, 1e-6);
    }
}

/// A sphere pressed at a wall through the film in between reaches it no faster than the water lets it: its energy is what the force has put in.
#[test]
fn energy_is_kept_in_a_closing_film() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let rail = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    let block = Body::new(Shape::cuboid([0.4, 0.4, 0.1]).faces(720)).density(1000.0);
    scene.add(block.at([0.0, 0.0, 0.05 + 0.08]).joint(rail));
    scene.initial.v = vec![-0.1];
    scene.time_step = 0.005;
    let simulator = Simulator::new(&scene, settings(Integrator::Midpoint)).unwrap();
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, 120))
        .unwrap();
    let energy: Vec<f64> = (rollout.samples().iter())
        .map(|s| s.kinetic_energy)
        .collect();
    let last = rollout.samples().last().unwrap();
    let gap = rollout.gaps().last().unwrap().unwrap().distance;
    let off = (energy.last().unwrap() / energy[0] - 1.0).abs();
    println!("gap {:?}, speed {}, energy {off:.1e}", gap, last.v[0]);
    // The film takes the energy over: the block slows down as the gap closes.
    assert!(gap < 0.05 && last.v[0].abs() < 0.09);
    assert!(off < 1e-3, "{off:e}");
}
