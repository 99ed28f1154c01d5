//! The gradient against differences in each mode of contact, which the run is shown to keep.

use super::{above_floor, contact, isolated, run, touching, velocities};
use hydrograd::Simulator;
use hydrograd::dynamics::Dual;
use hydrograd::scene::{Body, Scene, Shape};
use hydrograd::simulate::gradcheck::{self, gradcheck};

/// Whether some contact presses, in each step.
fn loaded(simulator: &Simulator, steps: usize) -> Vec<bool> {
    let stepper = simulator.stepper();
    let rollout = run(simulator, steps);
    let states = rollout.states().iter().zip(rollout.samples());
    states
        .take(steps)
        .map(|(state, sample)| {
            let e = stepper.linearise(&state.q, 0.0).unwrap();
            let [_, after] = velocities(&stepper, &e, state, &sample.v);
            e.contact_force(&after, Dual::User).norm() > 0.0
        })
        .collect()
}

fn agrees(name: &str, simulator: &mut Simulator, steps: usize) {
    let asked = gradcheck::GradcheckSettings {
        steps,
        directions: 4,
        seed: 7,
        timings: 0,
        enough: Some(1e-5),
    };
    let report = gradcheck(simulator, &asked).unwrap();
    println!("{name}: {:.1e}", report.max_rel_error);
    assert!(
        report.max_rel_error <= 1e-5,
        "{name}: {:#?}",
        report.directions
    );
}

fn tumbling(height: f64) -> Scene {
    let mut scene = above_floor(0.0);
    scene.add(
        Body::new(Shape::ellipsoid([0.2, 0.1, 0.15]))
            .density(1000.0)
            .at([0.0, 0.0, height])
            .rotated([0.2, 0.3, 0.0]),
    );
    scene.initial.v = vec![0.8, 0.2, -1.0, 0.6, -0.4, 0.5];
    contact(&mut scene).stiffness = Some(5e4);
    scene
}

#[test]
fn approach() {
    let mut simulator = isolated(&tumbling(0.28));
    let steps = 12;
    let loaded = loaded(&simulator, steps);
    // It falls freely and ends in contact.
    assert!(!loaded[steps / 2] && loaded[steps - 1], "{loaded:?}");
    agrees("approach", &mut simulator, steps);
}

#[test]
fn release() {
    // Pressed in, with a velocity upwards.
    let mut scene = tumbling(0.14);
    scene.initial.v[2] = 1.0;
    let mut simulator = isolated(&scene);
    let steps = 12;
    let loaded = loaded(&simulator, steps);
    assert!(loaded[0] && !loaded[steps - 1], "{loaded:?}");
    agrees("release", &mut simulator, steps);
}

/// A block on a slope: below the angle of friction, and above it.
fn on_a_slope(slope: f64) -> Simulator {
    let angle = slope.atan();
    let mut scene = touching(0.0);
    scene.add_wall([0.0; 3], [angle.sin(), 0.0, angle.cos()]);
    scene.add(
        Body::new(Shape::cuboid([0.3, 0.3, 0.1]))
            .density(1000.0)
            .at([0.0507 * angle.sin(), 0.0, 0.0507 * angle.cos()])
            .rotated([0.0, angle, 0.0]),
    );
    // So that differences stay in the mode: they move it by up to some centimetres and turn it.
    contact(&mut scene).stiffness = Some(2e4);
    contact(&mut scene).stiction_speed = if slope < 0.5 { 0.05 } else { 1e-3 };
    isolated(&scene)
}

#[test]
fn stick() {
    let mut simulator = on_a_slope(0.3);
    let steps = 30;
    assert!(loaded(&simulator, steps).iter().all(|x| *x));
    let speed = run(&simulator, steps).samples()[steps]
        .v
        .fixed_rows::<3>(0)
        .norm();
    // It creeps, below the speed from which on friction is fully there.
    assert!(speed < 0.05, "{speed}");
    agrees("stick", &mut simulator, steps);
}

#[test]
fn slip() {
    let mut simulator = on_a_slope(0.9);
    let steps = 30;
    assert!(loaded(&simulator, steps).iter().all(|x| *x));
    let samples = run(&simulator, steps);
    let speed = samples.samples()[steps].v.fixed_rows::<3>(0).norm();
    assert!(speed > 100.0 * 1e-3, "{speed}");
    agrees("slip", &mut simulator, steps);
}
