//! What every integrator that solves contact does with it, and with joint limits: rest, sliding, gradients; the others refuse.

use super::joints::{arm, slider};
use super::tools::{above_floor, above_slope, contact};
use crate::support::{CONTACT_INTEGRATORS, GRAVITY, check_gradient, run, says, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Joint, Mimic, Plane, Preset, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};

/// Dropped on the floor it rests where its weight presses it to, at any stiffness.
#[test]
fn a_ball_falls_and_comes_to_rest() {
    let mass = 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-3;
    for integrator in CONTACT_INTEGRATORS {
        for (stiffness, width) in [
            (1e4, Some(1e-4)),
            (1e5, None),
            (1e6, Some(1e-4)),
            (1e9, Some(1e-4)),
        ] {
            let mut scene = above_floor(0.0);
            let c = contact(&mut scene);
            (c.stiffness, c.gap, c.width) = (Some(stiffness), Some(0.002), width);
            let ball = Body::new(Shape::sphere(0.1)).density(1000.0);
            scene.add(ball.at([0.0, 0.0, 0.3]));
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 300);
            let at = |n: usize| rollout.samples()[n].poses[0].translation;
            // It falls freely until it touches at t = √(2 · 0.198/g) = 0.201 s; Euler's method takes the speed after each step.
            if integrator == Integrator::MomentumEuler {
                let fallen = 0.3 - at(18).z;
                let expected = 0.5 * GRAVITY * 0.01_f64.powi(2) * 18.0 * 19.0;
                assert!((fallen - expected).abs() < 1e-10, "{fallen}");
            }
            // Depth at which the smoothed law carries the weight; the default width is less than that.
            let depth = mass * GRAVITY / stiffness;
            let depth = match width {
                Some(width) if depth < width => 2.0 * (width * depth).sqrt() - width,
                _ => depth,
            };
            let rest = 0.102 - depth;
            let (v, moved) = (&rollout.samples()[300].v, at(300) - at(299));
            println!(
                "{integrator:?} {stiffness:.0e}: {:.1e} m off, reads {:.6} m/s, moves {:.1e} m a step",
                at(300).z - rest,
                v[2],
                moved.norm(),
            );
            assert!((at(300).z - rest).abs() < 1e-6);
            assert!(moved.norm() < 1e-8);
            assert!(v.norm() < 1e-6, "{v}");
        }
    }
}

#[test]
fn a_block_sticks_below_the_friction_angle_and_slides_above() {
    let friction = 0.5;
    for integrator in CONTACT_INTEGRATORS {
        for (slope, sticks) in [(0.4_f64, true), (0.6, false)] {
            let mut scene = above_slope(slope, 0.0);
            contact(&mut scene).friction = friction;
            let angle = slope.atan();
            scene.add(
                Body::new(Shape::cuboid([0.3, 0.3, 0.1]))
                    .density(1000.0)
                    .at([0.05 * angle.sin(), 0.0, 0.05 * angle.cos()])
                    .rotated([0.0, angle, 0.0]),
            );
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 200);
            let along = |n: usize| {
                let p = rollout.samples()[n].poses[0].translation;
                p.x * angle.cos() - p.z * angle.sin()
            };
            if sticks {
                // Creep at v_s · tan(slope)/√(μ² − tan²) at most, over 1.8 seconds.
                let creep = 1e-3 * slope / (friction * friction - slope * slope).sqrt();
                let moved = along(200) - along(20);
                println!("{integrator:?}: creeps {:.2e} m/s", moved / 1.8);
                assert!(moved.abs() <= 1.1 * creep * 1.8, "{integrator:?}: {moved}");
            } else {
                let expected = GRAVITY * (angle.sin() - friction * angle.cos());
                let found = (along(200) - 2.0 * along(150) + along(100)) / 0.25;
                println!("{integrator:?}: slides at {found:.4} m/s², Coulomb {expected:.4}");
                assert!((found - expected).abs() < 0.01 * expected, "{integrator:?}");
            }
        }
    }
}

/// Before anything touches, contact changes no bit.
#[test]
fn nothing_changes_where_nothing_touches() {
    for integrator in CONTACT_INTEGRATORS {
        let mut with = above_floor(0.0);
        let body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.15])).density(1000.0);
        with.add(body.at([0.0, 0.0, 2.0]));
        with.initial.v = vec![1.0, 0.2, -0.5, 0.3, -0.2, 0.4];
        let mut without = with.clone();
        without.contact = None;
        let ends = [with, without].map(|scene| {
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 20);
            rollout.states()[20].clone()
        });
        assert_eq!(ends[0], ends[1], "{integrator:?}");
    }
}

/// An ellipsoid that lands, slides and comes off; a ball pressed on a block; a ball that lands in water.
fn landing() -> [(&'static str, Scene, Fidelity); 3] {
    let mut sliding = above_floor(0.0);
    sliding.add(
        Body::new(Shape::ellipsoid([0.2, 0.1, 0.15]))
            .density(1000.0)
            .at([0.0, 0.0, 0.17])
            .rotated([0.2, 0.3, 0.0]),
    );
    sliding.initial.v = vec![1.0, 0.2, -0.5, 0.3, -0.2, 0.4];
    let mut pressed = above_floor(0.0);
    let block = Body::new(Shape::cuboid([0.3, 0.2, 0.1])).density(1000.0);
    pressed.add(block.at([0.0, 0.0, 0.051]));
    let ball = Body::new(Shape::sphere(0.08)).density(2000.0);
    pressed.add(ball.at([0.03, 0.02, 0.19]));
    let mut submerged = above_floor(1000.0);
    submerged.add(
        Body::new(Shape::sphere(0.1))
            .density(3000.0)
            .at([0.0, 0.0, 0.2])
            .joint(Joint::Planar { plane: Plane::Zx }),
    );
    submerged.initial.v = vec![-0.3, 0.2, 0.0];
    [
        ("sliding", sliding, Fidelity::Isolated),
        ("pressed", pressed, Fidelity::Isolated),
        ("submerged", submerged, Fidelity::Reduced),
    ]
}

/// Joints that are driven past their limits, in vacuum and in water.
fn limited() -> [(&'static str, Scene, Fidelity); 3] {
    [
        ("slider", slider(), Fidelity::Isolated),
        ("arm", arm(0.0), Fidelity::Isolated),
        ("arm in water", arm(998.0), Fidelity::Reduced),
    ]
}

const STEPS: usize = 40;

/// Approach, stick, slip and release, in vacuum and in water; joints on their way to the limit and at it.
fn gradients(integrator: Integrator) {
    for (name, scene, fidelity) in landing() {
        let mut with = simulator(&scene, fidelity, integrator);
        let mut alone = scene.clone();
        (alone.contact, alone.walls) = (None, Vec::new());
        let alone = simulator(&alone, fidelity, integrator);
        let [there, free] = [&with, &alone].map(|s| run(s, STEPS).samples()[STEPS].q.clone());
        assert!((there - free).norm() > 0.1, "{name}: nothing touches");
        check_gradient(&format!("{name} {integrator:?}"), &mut with, STEPS, 1, 1e-5);
    }
    for (name, scene, fidelity) in limited() {
        let mut simulator = simulator(&scene, fidelity, integrator);
        let rollout = run(&simulator, STEPS);
        for limit in &simulator.system().limits {
            let q = rollout.samples().iter().map(|s| s.q[limit.q]);
            let [low, high] = limit.range;
            let past = q.fold(0.0_f64, |m, q| m.max(q - high).max(low - q));
            assert!(past > 0.0, "{name}: {limit:?} is not reached");
        }
        drop(rollout);
        check_gradient(
            &format!("{name} {integrator:?}"),
            &mut simulator,
            STEPS,
            1,
            1e-5,
        );
    }
}

#[test]
fn gradients_with_momentum_euler() {
    gradients(Integrator::MomentumEuler);
}

#[test]
fn gradients_with_midpoint() {
    gradients(Integrator::Midpoint);
}

#[test]
fn gradients_with_velocity_euler() {
    gradients(Integrator::VelocityEuler);
}

#[test]
fn integrators_that_cannot_do_it_say_so() {
    let mut ball = above_floor(0.0);
    ball.add(
        Body::new(Shape::sphere(0.1))
            .density(1000.0)
            .at([0.0, 0.0, 0.3]),
    );
    for (mut scene, words) in [
        (ball, &["contact"][..]),
        (slider(), &["limits", "\"slider\""]),
    ] {
        for integrator in [Integrator::Rk2, Integrator::Rk4] {
            let settings = Settings::default().fidelity(Fidelity::Isolated);
            let made = Simulator::new(&scene, settings.integrator(integrator));
            let said = made.map(|_| ()).unwrap_err();
            says(&said, words);
            says(&said, &["momentum-euler", "midpoint", "velocity-euler"]);
        }
        let chosen = |scene: &Scene| Settings::default().resolve(scene).integrator;
        assert_eq!(chosen(&scene), Integrator::MomentumEuler);
        // It says so, and only where it wasn't asked for.
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let made = |settings| Simulator::new(&scene, settings).unwrap();
        let reasons = made(settings.clone()).reasons().join("; ");
        let told = ["momentum-euler", "in place of", "midpoint"];
        assert!(
            told.iter().chain(words).all(|w| reasons.contains(w)),
            "{reasons}"
        );
        let asked = made(settings.integrator(Integrator::MomentumEuler));
        assert!(!asked.reasons().join("; ").contains("in place of"));
        scene.preset = Preset::Paper;
        assert_eq!(chosen(&scene), Integrator::VelocityEuler);
    }
}

/// Something rests on the floor, and wheels that are geared to one another spin on three metres away: what contact does to the one takes nothing of the others. Energy Euler took 4.4 % of their speed here.
#[test]
fn what_spins_beside_a_contact_spins_on() {
    let axis = [0.0, 0.0, 1.0];
    for integrator in CONTACT_INTEGRATORS {
        for (density, resting) in [(0.0, true), (998.0, true), (0.0, false)] {
            let mut scene = above_floor(density);
            contact(&mut scene);
            let block = || Body::new(Shape::cuboid([0.2, 0.2, 0.1]).faces(80)).mass(10.0);
            let height = if resting { 0.052 } else { 0.3 };
            scene.add(block().named("block").at([0.0, 0.0, height]));
            let wheel = |name: &str, z: f64| {
                let wheel = block().named(name).at([3.0, 0.0, z]);
                wheel.joint(Joint::Revolute { axis })
            };
            scene.add(wheel("wheel", 2.0));
            scene.add(wheel("other", 3.0).mimic(Mimic::new("wheel").ratio(-1.0)));
            scene.initial.v = vec![0.0; 7];
            scene.initial.v[6] = 30.0;
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 200);
            let samples = rollout.samples();
            let lost = samples.iter().map(|s| (s.v[6] / 30.0 - 1.0).abs());
            let lost = lost.fold(0.0, f64::max);
            println!("{integrator:?}, {density} kg/m³, from {height} m: {lost:.1e} of the speed");
            assert!(lost < 1e-12, "{integrator:?}, {density}: {lost}");
            assert!(samples[200].v.rows(0, 6).norm() < 1e-5, "{integrator:?}");
        }
    }
}
