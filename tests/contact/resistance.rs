//! Torsional and rolling friction against closed forms, and their gradients.

use super::tools::{above_floor, contact, on_slope, threshold, within};
use crate::support::{CONTACT_INTEGRATORS, GRAVITY, check_gradient, run, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Scene, Shape};
use hydrograd::{Fidelity, Simulator};

const RADIUS: f64 = 0.1;

fn made(scene: &Scene) -> Simulator {
    simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler)
}

fn on_floor(shape: Shape, height: f64) -> Scene {
    let mut scene = above_floor(0.0);
    let gap = 0.01 * RADIUS;
    let body = Body::new(shape).density(1000.0);
    scene.add(body.at([0.0, 0.0, height + gap]));
    scene
}

/// On its lowest point: α = μ_t N/I, to rest; without torsional friction it never stops.
#[test]
fn what_spins_on_its_point_stops() {
    let ellipsoid = Shape::ellipsoid([RADIUS, RADIUS, 0.06]);
    for (shape, height) in [(Shape::sphere(RADIUS), RADIUS), (ellipsoid, 0.06)] {
        for integrator in CONTACT_INTEGRATORS {
            for torsional in [0.0, 0.002] {
                let mut scene = on_floor(shape.clone(), height);
                contact(&mut scene).torsional_friction = torsional;
                scene.initial.v = vec![0.0, 0.0, 0.0, 0.0, 0.0, 5.0];
                let rollout = run(&simulator(&scene, Fidelity::Isolated, integrator), 200);
                let spin = |n: usize| rollout.samples()[n].v[5];
                if torsional == 0.0 {
                    assert!((spin(200) - 5.0).abs() < 1e-9, "{}", spin(200));
                    continue;
                }
                let exact = torsional * GRAVITY / (0.4 * RADIUS * RADIUS);
                let what = format!("{integrator:?}, spin slows by, rad/s²");
                within(&what, (spin(20) - spin(60)) / 0.4, exact, 0.01);
                // Creep at the stiction speed over the radius takes over there.
                assert!(spin(200).abs() < 1e-3, "{}", spin(200));
            }
        }
    }
}

/// A ball that rolls: a = 5/7 g μ_r/r, to rest.
#[test]
fn a_rolling_ball_slows_down() {
    for rolling in [0.002, 0.01] {
        let mut scene = on_floor(Shape::sphere(RADIUS), RADIUS);
        contact(&mut scene).rolling_friction = rolling;
        let speed = 0.5;
        scene.initial.v = vec![speed, 0.0, 0.0, 0.0, speed / RADIUS, 0.0];
        let exact = 5.0 / 7.0 * GRAVITY * rolling / RADIUS;
        let stops = (speed / exact / 0.01) as usize;
        let rollout = run(&made(&scene), 2 * stops);
        let x = |n: usize| rollout.samples()[n].poses[0].translation.x;
        let n = stops / 4;
        let slows = -(x(3 * n) - 2.0 * x(2 * n) + x(n)) / (n as f64 * 0.01).powi(2);
        within("rolling slows by, m/s²", slows, exact, 0.01);
        within(
            "rolls to rest over, m",
            x(2 * stops),
            speed * speed / (2.0 * exact),
            0.02,
        );
    }
}

/// The slope from which on a ball rolls is μ_r/r.
#[test]
fn rolling_resistance_holds_a_ball_on_a_slope() {
    let rolling = 0.01;
    let exact = rolling / RADIUS;
    let rolls = |slope: f64| {
        let mut scene = on_slope(slope, 1.01 * RADIUS, Shape::sphere(RADIUS));
        contact(&mut scene).rolling_friction = rolling;
        let rollout = run(&made(&scene), 400);
        let at = |n: usize| rollout.samples()[n].poses[0].translation;
        (at(400) - at(300)).norm() > 0.01
    };
    let found = threshold(rolls, [0.8 * exact, 1.2 * exact], 1e-3 * exact);
    within("slope of rolling", found, exact, 0.01);
}

/// A ball, an ellipsoid and a box that land, spin, roll and slide on a floor.
#[test]
fn gradients_through_torsional_and_rolling_friction() {
    for integrator in CONTACT_INTEGRATORS {
        let mut scene = above_floor(0.0);
        let c = contact(&mut scene);
        (c.torsional_friction, c.rolling_friction) = (0.004, 0.003);
        let ball = Body::new(Shape::sphere(RADIUS)).density(1000.0);
        scene.add(ball.at([0.0, 0.0, 0.11]));
        let ellipsoid = Body::new(Shape::ellipsoid([0.2, 0.1, 0.15])).density(1000.0);
        let turned = ellipsoid.at([0.6, 0.0, 0.17]).rotated([0.2, 0.3, 0.0]);
        scene.add(turned);
        let block = Body::new(Shape::cuboid([0.3, 0.2, 0.1])).density(1000.0);
        scene.add(block.at([1.5, 0.0, 0.06]));
        scene.initial.v = vec![
            0.5, 0.1, -0.2, 0.3, 5.0, 4.0, 0.3, 0.2, -0.5, 0.3, -0.2, 3.0, 0.8, 0.2, -0.1, 0.0,
            0.0, 2.0,
        ];
        let mut simulator = simulator(&scene, Fidelity::Isolated, integrator);
        check_gradient(&format!("{integrator:?}"), &mut simulator, 40, 3, 1e-5);
    }
}
