//! Continuity: where a bouncing ball ends as its start varies, and derivatives across and at changes of mode.

use super::{GRAVITY, RAIL, above_floor, contact, isolated, run, touching};
use hydrograd::scene::{Body, Joint, Scene, Shape};
use hydrograd::{Controls, Simulator};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_PI_2;

/// A ball on a vertical rail, half a metre up; with a soft floor from which it comes back, or the default one.
fn bouncing(stiffness: Option<f64>) -> Simulator {
    let mut scene = above_floor(0.0);
    scene.add(
        Body::new(Shape::sphere(0.1))
            .density(1000.0)
            .at([0.0, 0.0, 0.5])
            .joint(RAIL),
    );
    contact(&mut scene).stiffness = stiffness;
    contact(&mut scene).dissipation = if stiffness.is_some() { 0.1 } else { 0.5 };
    isolated(&scene)
}

/// Coordinate at the end, started `dq` away.
fn end(simulator: &mut Simulator, steps: usize, dq: f64) -> f64 {
    let (q, v) = simulator.start();
    let (q, v) = (q.clone(), v.clone());
    let moved = DVector::from_element(1, dq);
    simulator.set_start(&q + moved, v.clone()).unwrap();
    let out = run(simulator, steps).samples()[steps].q[0];
    simulator.set_start(q, v).unwrap();
    out
}

/// Where neighbours on a grid of start heights end farthest apart, ever finer grids halve that distance: no jump, however small.
#[test]
fn the_end_height_of_a_bouncing_ball_has_no_jumps() {
    // Softly, with up to three bounces; harder, with one; near rigid, where half the starts haven't landed yet.
    for (stiffness, steps) in [(Some(2e3), 120), (Some(2e4), 50), (None, 30)] {
        let mut simulator = bouncing(stiffness);
        let n = 400;
        let spacing = 0.2 / f64::from(n);
        let ends: Vec<f64> = (0..=n)
            .map(|i| end(&mut simulator, steps, -0.1 + spacing * f64::from(i)))
            .collect();
        let range = |x: &[f64]| {
            let (low, high) = x
                .iter()
                .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
            high - low
        };
        let jump = |x: &[f64]| {
            let steps = x.windows(2).map(|w| (w[1] - w[0]).abs());
            let at = steps.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            at.expect("neighbours")
        };
        let (at, first) = jump(&ends);
        let from = -0.1 + spacing * at as f64;
        println!(
            "stiffness {stiffness:?}: ends over {:.3} m, largest step {first:.2e} m for {spacing:.1e} m, at {:.4} m",
            range(&ends),
            0.5 + from
        );
        // The interval in 2, 4, … 1024 parts.
        let mut last = first;
        for halvings in 1..=10 {
            let parts = 1 << halvings;
            let inside: Vec<f64> = (0..=parts)
                .map(|i| {
                    end(
                        &mut simulator,
                        steps,
                        from + spacing * f64::from(i) / f64::from(parts),
                    )
                })
                .collect();
            last = jump(&inside).1;
        }
        println!(
            "  in 1024 parts: {last:.2e} m, {:.2} of it over 1024",
            last / first * 1024.0
        );
        assert!(last <= 2.0 * first / 1024.0, "{first} becomes {last}");
        // It does depend on where it starts.
        assert!(range(&ends) > 1e-4 && first > 0.0);
    }
}

/// Derivative of one coordinate at the end by the adjoint.
fn slope(simulator: &mut Simulator, steps: usize, dq: f64) -> f64 {
    let (q, v) = simulator.start();
    let (q, v) = (q.clone(), v.clone());
    simulator
        .set_start(&q + DVector::from_element(1, dq), v.clone())
        .unwrap();
    let out = {
        let rollout = run(simulator, steps);
        let mut seed = rollout.zero_cotangents();
        seed.q[(0, steps)] = 1.0;
        rollout.vjp(&seed).unwrap().initial.q[0]
    };
    simulator.set_start(q, v).unwrap();
    out
}

/// From a flight that just ends before contact to one that ends in it: at every start height derivative and differences have one sign
/// and one size.
#[test]
fn derivatives_hold_from_approach_to_contact() {
    for stiffness in [Some(2e4), None] {
        let mut simulator = bouncing(stiffness);
        let steps = 30;
        // Where contact first acts: fallen freely, it ends at the gap and the width.
        let touch = 0.1 + 1e-3 + 4e-4;
        let fallen = 0.5 * GRAVITY * 1e-4 * (steps * (steps + 1)) as f64;
        let threshold = touch + fallen - 0.5;
        let (mut signs, mut worst) = (Vec::new(), 0.0_f64);
        for i in -20..=20 {
            let dq = threshold + 1e-4 * f64::from(i);
            let found = slope(&mut simulator, steps, dq);
            let h = 1e-7;
            let differences = (end(&mut simulator, steps, dq + h)
                - end(&mut simulator, steps, dq - h))
                / (2.0 * h);
            worst = worst.max((found - differences).abs());
            assert!(found.is_finite() && found.signum() == differences.signum());
            signs.push(found);
        }
        println!(
            "stiffness {stiffness:?}: derivative from {:.3} in contact to {:.3} free; worst against differences {worst:.1e}",
            signs[0], signs[40]
        );
        // The law's slope has kinks at both ends of the width, across which differences take the mean.
        assert!(worst < 1e-3, "{worst}");
        assert!(
            (signs[40] - 1.0).abs() < 1e-12,
            "free flight hands heights on"
        );
        assert!(signs[0] < 0.9, "contact doesn't");
    }
}

/// A block pushed along the floor by ever more force: from creep to sliding.
#[test]
fn derivatives_hold_from_stick_to_slip() {
    let mut scene = above_floor(0.0);
    scene.add(
        Body::new(Shape::cuboid([0.3, 0.3, 0.1]))
            .density(1000.0)
            .at([0.0, 0.0, 0.051])
            .thruster(),
    );
    let simulator = isolated(&scene);
    let steps = 50;
    let weight = 9.0 * GRAVITY;
    let pushed = |force: f64| {
        let mut u = DMatrix::zeros(6, steps);
        u.row_mut(0).fill(force);
        let controls = Controls::from_matrix(&simulator, u).unwrap();
        let rollout = simulator.rollout(&controls).unwrap();
        let mut seed = rollout.zero_cotangents();
        seed.positions[(0, steps)] = 1.0;
        let slope = rollout.vjp(&seed).unwrap().controls.row(0).sum();
        (rollout.samples()[steps].poses[0].translation.x, slope)
    };
    let (mut first, mut last, mut worst) = (0.0, 0.0, 0.0_f64);
    for i in 0..=40 {
        let force = weight * (0.3 + 0.01 * f64::from(i));
        let (_, found) = pushed(force);
        let h = 1e-4;
        let differences = (pushed(force + h).0 - pushed(force - h).0) / (2.0 * h);
        assert!(found > 0.0 && differences > 0.0, "{found} {differences}");
        worst = worst.max((found - differences).abs() / found);
        if i == 0 {
            first = found;
        }
        last = found;
    }
    println!("stick {first:.2e} m/N, slip {last:.2e} m/N; worst against differences {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
    // Sliding for half a second: ½ t²/m.
    let free = 0.5 * 0.25 / 9.0;
    assert!(first < 0.05 * free && last > 0.8 * free && last < 1.1 * free);
}

/// At the very point where the law changes: just touching, at rest against one another, and with faces that lie on one another.
#[test]
fn gradients_at_a_change_of_mode_are_finite() {
    let mut cases: Vec<(&str, Scene)> = Vec::new();
    for gravity in [0.0, GRAVITY] {
        for (name, beyond) in [("touch", 0.0), ("outer edge", 4e-4), ("inner edge", -4e-4)] {
            let mut scene = above_floor(0.0);
            scene.gravity = [0.0, 0.0, -gravity];
            scene.add(Body::new(Shape::sphere(0.1)).density(1000.0).at([
                0.0,
                0.0,
                0.1 + 1e-3 + beyond,
            ]));
            cases.push((name, scene));
        }
        let block = |z: f64| {
            Body::new(Shape::cuboid([0.3, 0.2, 0.1]))
                .density(1000.0)
                .at([0.0, 0.0, z])
        };
        let mut flat = above_floor(0.0);
        flat.gravity = [0.0, 0.0, -gravity];
        flat.add(block(0.051));
        cases.push(("flat box", flat.clone()));
        flat.add(block(0.152));
        cases.push(("box on box, edges in line", flat));
        let mut rods = touching(0.0);
        rods.gravity = [0.0, 0.0, -gravity];
        let rod = |z: f64| {
            Body::new(Shape::capsule(0.05, 0.3))
                .density(1000.0)
                .at([0.0, 0.0, z])
        };
        rods.add(rod(0.0).rotated([0.0, FRAC_PI_2, 0.0]).joint(Joint::Fixed));
        rods.add(rod(0.1005).rotated([0.0, FRAC_PI_2, 0.0]));
        cases.push(("parallel rods", rods));
        let mut crossed = touching(0.0);
        crossed.gravity = [0.0, 0.0, -gravity];
        crossed.add(rod(0.0).rotated([0.0, FRAC_PI_2, 0.0]).joint(Joint::Fixed));
        crossed.add(rod(0.1005).rotated([FRAC_PI_2, 0.0, 0.0]));
        cases.push(("crossed rods", crossed));
    }
    for (name, mut scene) in cases {
        for density in [0.0, 1000.0] {
            scene.fluid.density = density;
            let simulator = isolated(&scene);
            for steps in [1, 2, 20] {
                let rollout = run(&simulator, steps);
                let mut seed = rollout.zero_cotangents();
                seed.v.fill(0.7);
                seed.positions.fill(-0.4);
                seed.rotations.fill(0.3);
                let g = rollout.vjp(&seed).unwrap();
                let all = g.initial.q.iter().chain(g.initial.v.iter()).copied();
                let parameters = g.parameters.to_vec();
                assert!(
                    all.chain(parameters).all(|x| x.is_finite()),
                    "{name}, {steps} steps, density {density}"
                );
                assert!(g.initial.v.norm() > 0.0, "{name}");
            }
        }
    }
}
