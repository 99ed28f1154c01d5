//! What a run's summary says of momentum and energy.

use crate::support::example;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::Rollout;
use hydrograd::{Controls, Fidelity, Settings, Simulator};

const DRAG: Drag = Drag {
    part: DragPart::Total,
    linear: 1.0,
    quadratic_part: DragPart::Total,
    quadratic: 1.0,
};

fn run(scene: &Scene, settings: Settings, steps: usize) -> Rollout {
    let simulator = Simulator::new(scene, settings).unwrap();
    let zero = Controls::zeros(&simulator, steps);
    simulator.rollout(&zero).unwrap()
}

fn isolated() -> Settings {
    Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(Integrator::Rk4)
}

fn heavy() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add(Body::new(Shape::ellipsoid([0.1, 0.07, 0.05]).faces(320)).density(2000.0));
    scene.initial.v = vec![0.3, 0.1, 0.2, 1.0, -2.0, 0.5];
    scene
}

/// Momentum counts only where nothing outside acts on it: not along weight, nor along what joints hold.
#[test]
fn the_momentum_that_is_told_is_that_in_which_nothing_outside_acts() {
    // Falling: two translations, and turning about the vertical.
    let summary = run(&heavy(), isolated(), 100).summary();
    let drift = summary.momentum_drift.unwrap();
    println!("falling: {drift:.1e} of {}", summary.momenta_kept);
    assert_eq!(summary.momenta_kept, 3);
    assert!(drift < 1e-9, "{drift}");

    // A slope's normal isn't the weight's: only the axis of both is left.
    let mut walled = heavy();
    walled.gravity = [1.0, 0.0, -9.81];
    walled.add_wall([0.0, 0.0, -3.0], [0.0, 0.0, 1.0]);
    let summary = run(&walled, isolated().fidelity(Fidelity::Reduced), 20).summary();
    let drift = summary.momentum_drift.unwrap();
    println!("over a wall: {drift:.1e} of {}", summary.momenta_kept);
    assert_eq!(summary.momenta_kept, 1);
    assert!(drift < 1e-9, "{drift}");

    // Coins in planar joints: what holds them in the plane isn't counted.
    let coins = example("coins");
    let summary = run(&coins, Settings::default(), 100).summary();
    let drift = summary.momentum_drift;
    println!("coins: {drift:?} of {}", summary.momenta_kept);
    assert!(drift.is_none_or(|drift| drift < 1e-9), "{drift:?}");

    // Drag knows how a body moves through the water: nothing is kept.
    let mut dragged = heavy();
    dragged.bodies[0] = dragged.bodies[0].clone().drag(DRAG);
    let summary = run(&dragged, isolated(), 10).summary();
    assert_eq!((summary.momenta_kept, summary.momentum_drift), (0, None));

    // Turning about anything but the current.
    let mut current = heavy();
    current.gravity = [0.0; 3];
    current.fluid.current = [0.0, 1.0, 0.0];
    let summary = run(&current, isolated(), 100).summary();
    let drift = summary.momentum_drift.unwrap();
    println!("in a current: {drift:.1e} of {}", summary.momenta_kept);
    assert_eq!(summary.momenta_kept, 4);
    assert!(drift < 1e-9, "{drift}");
}

/// A body at rest whose weight is borne has round-off for momentum, and that isn't all of it.
#[test]
fn round_off_is_no_change_of_momentum() {
    let mut scene = heavy();
    scene.bodies[0].density = Some(scene.fluid.density);
    scene.initial.v = vec![];
    let summary = run(&scene, isolated(), 100).summary();
    let drift = summary.momentum_drift.unwrap();
    assert!(drift < 1e-4, "{drift}");
}

/// Energy that is lost where nothing takes it is told, as is energy that is gained.
#[test]
fn energy_that_is_lost_is_told() {
    let mut scene = heavy();
    scene.gravity = [0.0; 3];
    scene.initial.v = vec![0.0, 0.0, 0.0, 0.3, 140.0, 0.2];
    let rollout = run(&scene, isolated(), 100);
    let summary = rollout.summary();
    let part = summary.energy_loss / summary.energy_initial;
    println!(
        "one radian a step: {part:.3} lost, {:?}",
        rollout.warnings()
    );
    assert!(part > 0.02, "{part}");
    let told = rollout.warnings();
    assert!(
        told.iter().any(|w| w.contains("the energy falls by")),
        "{told:?}"
    );

    // With drag it is what drag takes.
    scene.bodies[0] = scene.bodies[0].clone().drag(DRAG);
    let rollout = run(&scene, isolated(), 100);
    assert!(rollout.summary().energy_loss > 0.0);
    let told = rollout.warnings();
    assert!(!told.iter().any(|w| w.contains("energy")), "{told:?}");
}

/// Joints hang on the world where they do: a hinge's bodies keep what their axis lets them.
#[test]
fn a_hinge_keeps_the_angular_momentum_about_its_axis() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let hinge = Joint::Revolute {
        axis: [0.0, 1.0, 0.0],
    };
    scene.add(
        Body::new(Shape::sphere(0.1).faces(80))
            .density(2000.0)
            .center_of_mass([0.3, 0.0, 0.1])
            .joint(hinge),
    );
    scene.initial.v = vec![2.0];
    let summary = run(&scene, isolated(), 50).summary();
    assert_eq!(summary.momenta_kept, 1);
    assert!(summary.momentum_drift.unwrap() < 1e-10);
}

/// Gravity is off unless it is asked for: a stone that stays where it is says so.
#[test]
fn a_dense_body_that_stays_is_told_of_gravity() {
    let mut scene = heavy();
    (scene.gravity, scene.initial.v) = ([0.0; 3], vec![]);
    let told = run(&scene, isolated(), 5).warnings();
    assert!(
        told.len() == 1 && told[0].contains("gravity = [0, 0, -9.81]"),
        "{told:?}"
    );
    // Not where it moves, nor where it would not fall.
    scene.initial.v = vec![0.1, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(run(&scene, isolated(), 5).warnings(), Vec::<String>::new());
    scene.initial.v = vec![];
    scene.bodies[0].density = Some(scene.fluid.density);
    assert_eq!(run(&scene, isolated(), 5).warnings(), Vec::<String>::new());
}
