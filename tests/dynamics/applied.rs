//! Effort of what a controller adds: derivatives by its gains, both ways, against differences.

use crate::support::{INTEGRATORS, forward, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Controller, Drag, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::Checkpoints;
use hydrograd::{Controls, Fidelity, Rollout, Simulator, objective};
use nalgebra::DMatrix;
use std::ops::ControlFlow;

/// An arm of two links in the water, each joint held at a target.
fn arm(integrator: Integrator) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    let link = |name: &str, axis| {
        let shape = Shape::ellipsoid([0.2, 0.05, 0.04]).faces(80);
        let drag = Drag::default();
        let body = Body::new(shape).named(name).density(1400.0).drag(drag);
        let body = body.shape_at([0.2, 0.0, 0.0], [0.0; 3]);
        body.joint(Joint::Revolute { axis }).actuated()
    };
    scene.add(link("upper", [0.0, 1.0, 0.0]));
    let lower = link("lower", [0.0, 0.6, 0.8]).at([0.42, 0.0, 0.0]);
    scene.add(lower.child_of("upper"));
    scene.controller = Some(Controller::Pd {
        target: vec![0.4, -0.7],
        stiffness: vec![9.0, 5.0],
        damping: vec![1.2, 0.6],
    });
    simulator(&scene, Fidelity::Isolated, integrator)
}

fn run(simulator: &Simulator) -> Rollout {
    let open = DMatrix::from_fn(2, 30, |i, n| 0.3 * (i as f64 + 0.4 * n as f64).sin());
    let controls = Controls::from_matrix(simulator, open).unwrap();
    simulator.rollout(&controls).unwrap()
}

#[test]
fn gains_have_gradients_of_the_effort_that_they_make() {
    let effort = objective::applied_effort(0.1) + objective::effort(0.5);
    let own = |rollout: &Rollout| {
        let of = |u: &DMatrix<f64>| u.norm_squared();
        0.1 * of(&rollout.applied_controls()) + 0.5 * of(rollout.controls())
    };
    for integrator in INTEGRATORS {
        let sim = arm(integrator);
        let rollout = run(&sim);
        let value = rollout.value(&effort).unwrap();
        assert!((value / own(&rollout) - 1.0).abs() < 1e-14);
        let gradient = rollout.gradient(&effort).unwrap();
        let gains = sim.policy().gains();
        assert_eq!(gains.len(), 6);
        let at = |i: usize, h: f64| {
            let mut moved = gains.clone();
            moved[i] += h;
            let mut sim = sim.clone();
            sim.set_policy(sim.policy().with_gains(&moved).unwrap());
            own(&run(&sim))
        };
        let mut worst = 0.0_f64;
        for (i, slope) in gradient.gains.iter().enumerate() {
            let pair = |h: f64| at(i, h) - at(i, -h);
            let h = 1e-3;
            let difference = (8.0 * pair(h) - pair(2.0 * h)) / (12.0 * h);
            worst = worst.max((slope / difference - 1.0).abs());
        }
        let between = forward::gap(&rollout);
        println!("{integrator:?}: gains {worst:.1e}, forward against reverse {between:.1e}");
        assert!(worst < 1e-7 && between < forward::LIMIT, "{integrator:?}");
    }
}

/// In parts it is the same sum.
#[test]
fn effort_adds_up_over_parts() {
    let sim = arm(Integrator::Midpoint);
    let rollout = run(&sim);
    let effort = objective::applied_effort(0.1);
    let whole = rollout.gradient(&effort).unwrap();
    let controls = Controls::from_matrix(&sim, rollout.controls().clone()).unwrap();
    let kept = Checkpoints { part: 7, states: 3 };
    let made = sim
        .gradient_in_parts(&controls, &effort, kept, |_| ControlFlow::Continue(()))
        .unwrap();
    assert_eq!(made.gradient.gains, whole.gains);
    assert_eq!(made.gradient.controls, whole.controls);
    let value = rollout.value(&effort).unwrap();
    assert!((made.value / value - 1.0).abs() < 1e-14);
}
