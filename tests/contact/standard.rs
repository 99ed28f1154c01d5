//! Standard cases against closed forms: slopes, rolling, sliding to rest, tipping, a stack, a coin.

use super::tools::{above_floor, contact, on_slope, threshold, within};
use crate::support::{self, GRAVITY, run};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Scene, Shape};
use hydrograd::{Fidelity, Rollout, Simulator};

fn simulator(scene: &Scene) -> Simulator {
    support::simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler)
}

/// How far down the slope a body is after `n` steps, m.
fn along(rollout: &Rollout, slope: f64, n: usize) -> f64 {
    let p = rollout.samples()[n].poses[0].translation;
    let angle = slope.atan();
    p.x * angle.cos() - p.z * angle.sin()
}

/// The gap at which a box of this size rests flat on its four corners, m, by the law at its default stiffness: on a slope.
fn resting_gap(size: [f64; 3], dt: f64, slope: f64) -> f64 {
    let radius = 0.5 * size.map(|x| x * x).iter().sum::<f64>().sqrt();
    let (touch, width) = (0.01 * radius, 0.004 * radius);
    let depth = GRAVITY * slope.atan().cos() * dt * dt / 40.0;
    assert!(depth < width);
    touch + width - 2.0 * (width * depth).sqrt()
}

/// The slope from which on a block slides, by bisection.
#[test]
fn slope_threshold() {
    for friction in [0.2, 0.5, 1.0] {
        let slides = |slope: f64| {
            let size = [0.3, 0.3, 0.1];
            let rest = 0.05 + resting_gap(size, 0.01, slope);
            let mut scene = on_slope(slope, rest, Shape::cuboid(size));
            contact(&mut scene).friction = friction;
            let rollout = run(&simulator(&scene), 400);
            // It creeps at less than ten times the stiction speed.
            along(&rollout, slope, 400) - along(&rollout, slope, 300) > 0.01
        };
        let found = threshold(slides, [0.9 * friction, 1.1 * friction], 1e-3 * friction);
        within("slope of slipping", found, friction, 0.01);
    }
}

#[test]
fn a_sphere_rolls_down_a_slope() {
    for slope in [0.1_f64, 0.3, 0.6] {
        let mut scene = on_slope(slope, 0.101, Shape::sphere(0.1));
        contact(&mut scene).friction = 0.5;
        let rollout = run(&simulator(&scene), 200);
        let s = |n: usize| along(&rollout, slope, n);
        let found = s(200) - 2.0 * s(150) + s(100);
        let exact = 5.0 / 7.0 * GRAVITY * slope.atan().sin();
        within("rolling down, m/s²", found / 0.25, exact, 0.01);
    }
}

#[test]
fn a_block_slides_to_rest() {
    for (speed, friction, dt) in [
        (1.0_f64, 0.3, 0.01),
        (2.0, 0.5, 0.01),
        (3.0, 0.5, 0.01),
        (2.0, 0.5, 0.0025),
    ] {
        let mut scene = above_floor(0.0);
        scene.time_step = dt;
        contact(&mut scene).friction = friction;
        let gap = 0.01 * 0.5 * (0.5_f64 * 0.5 + 0.5 * 0.5 + 0.1 * 0.1).sqrt();
        scene.add(
            Body::new(Shape::cuboid([0.5, 0.5, 0.1]))
                .density(1000.0)
                .at([0.0, 0.0, 0.05 + gap]),
        );
        scene.initial.v = vec![speed, 0.0, 0.0, 0.0, 0.0, 0.0];
        let stops = speed / (friction * GRAVITY);
        let steps = (1.2 * stops / dt) as usize;
        let rollout = run(&simulator(&scene), steps);
        let end = rollout.samples()[steps].poses[0].translation.x;
        let exact = speed * speed / (2.0 * friction * GRAVITY);
        println!("Δt {dt} s, {speed} m/s, μ {friction}:");
        // Euler's method takes the speed after each step: half a step less of the start's.
        within("slides to rest, m", end + 0.5 * speed * dt, exact, 0.01);
    }
}

/// A box on its lower edge falls back on its face below the angle of its diagonal, and over above it.
#[test]
fn a_box_tips_over_its_edge() {
    let (width, height) = (0.1_f64, 0.2_f64);
    let exact = (width / height).atan();
    let falls = |angle: f64| {
        let mut scene = above_floor(0.0);
        contact(&mut scene).friction = 1.0;
        let gap = 0.01 * 0.5 * (width * width + 0.1 * 0.1 + height * height).sqrt();
        // Turned about its right lower edge.
        let middle = Vec3::new(
            -0.5 * width * angle.cos() + 0.5 * height * angle.sin(),
            0.0,
            0.5 * width * angle.sin() + 0.5 * height * angle.cos() + gap,
        );
        scene.add(
            Body::new(Shape::cuboid([width, 0.1, height]))
                .density(1000.0)
                .at(middle.into())
                .rotated([0.0, angle, 0.0]),
        );
        let rollout = run(&simulator(&scene), 150);
        let up = rollout.samples()[150].poses[0].rotation[(2, 2)];
        up < 0.5
    };
    let found = threshold(falls, [0.9 * exact, 1.1 * exact], 1e-4);
    within("tipping angle, rad", found, exact, 0.005);
}

#[test]
fn a_stack_of_ten_stands_for_ten_seconds() {
    let mut scene = above_floor(0.0);
    for k in 0..10 {
        scene.add(
            Body::new(Shape::cuboid([0.2, 0.2, 0.1]))
                .density(1000.0)
                .at([0.0, 0.0, 0.052 + 0.102 * f64::from(k)]),
        );
    }
    let rollout = run(&simulator(&scene), 1000);
    let mut worst = 0.0_f64;
    for b in 0..10 {
        let at = |n: usize| rollout.samples()[n].poses[b].translation;
        let drift = at(1000) - at(100);
        worst = worst.max(drift.norm());
        let up = rollout.samples()[1000].poses[b].rotation[(2, 2)];
        assert!(up > 1.0 - 1e-8, "box {b} leans: {up}");
    }
    println!("ten boxes for 9 s: drift {worst:.1e} m at most");
    assert!(worst < 1e-4, "{worst}");
}

/// A coin that spins flat on the floor: with eight points at its rim it stops as a ring does, α = μ g R / (½ R²).
#[test]
fn a_coin_spins_to_rest() {
    for (spin, friction) in [(20.0, 0.3), (50.0, 0.5)] {
        let mut scene = above_floor(0.0);
        scene.time_step = 1e-3;
        contact(&mut scene).friction = friction;
        let radius = 0.05_f64;
        let gap = 0.01 * radius.hypot(0.0025);
        scene.add(
            Body::new(Shape::cylinder(radius, 0.005))
                .density(8000.0)
                .at([0.0, 0.0, 0.0025 + gap]),
        );
        scene.initial.v = vec![0.0, 0.0, 0.0, 0.0, 0.0, spin];
        let stops = spin * radius / (2.0 * friction * GRAVITY);
        let steps = (1.3 * stops / 1e-3) as usize;
        let rollout = run(&simulator(&scene), steps);
        let turned: f64 = rollout.samples().iter().map(|s| s.v[5] * 1e-3).sum();
        let exact = spin * stops / 2.0;
        within("coin turns until it rests, rad", turned, exact, 0.02);
        let moved = rollout.samples()[steps].poses[0].translation.xy().norm();
        println!("the coin moves aside by {moved:.1e} m");
        assert!(moved < 1e-4);
    }
}
