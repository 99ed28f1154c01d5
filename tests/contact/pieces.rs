//! Derivatives of steps in pieces, against differences.

use super::tools::{above_floor, contact, touching, under_gravity};
use crate::support::{CONTACT_INTEGRATORS, check_gradient, simulator};
use hydrograd::dynamics::{Input, InputTangents, Integrator, StateBar, StateTangents};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

fn pieces(simulator: &Simulator, steps: usize) -> Vec<usize> {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    rollout.pieces()
}

/// A box that lands fast and turning, and a ball that follows it.
fn landing(stiffness: Option<f64>) -> Scene {
    let mut scene = above_floor(0.0);
    scene.add(
        Body::new(Shape::cuboid([0.2, 0.1, 0.06]))
            .density(1000.0)
            .at([0.0, 0.0, 0.3])
            .rotated([0.4, 0.3, 0.2])
            .thruster(),
    );
    scene.add(
        Body::new(Shape::sphere(0.05))
            .density(1500.0)
            .at([0.03, 0.01, 0.55]),
    );
    scene.initial.v = vec![
        1.0, 0.5, -8.0, 4.0, -3.0, 5.0, 0.2, 0.3, -14.0, 1.0, 2.0, -1.0,
    ];
    contact(&mut scene).stiffness = stiffness;
    contact(&mut scene).width = Some(1e-3);
    scene
}

#[test]
fn gradients_through_pieces() {
    for integrator in CONTACT_INTEGRATORS {
        for stiffness in [None, Some(5e4)] {
            let mut simulator = simulator(&landing(stiffness), Fidelity::Isolated, integrator);
            let cut = pieces(&simulator, 6);
            println!("{integrator:?} {stiffness:?}: pieces {cut:?}");
            assert!(cut.iter().any(|n| *n > 1), "{cut:?}");
            let name = format!("{integrator:?} in pieces");
            check_gradient(&name, &mut simulator, 6, 2, 1e-6);
        }
    }
}

/// A joint that comes at its limit by several times a quarter of its range a step.
#[test]
fn gradients_through_pieces_at_a_limit() {
    for integrator in CONTACT_INTEGRATORS {
        let mut scene = under_gravity(0.0);
        scene.add(
            Body::dry()
                .named("slider")
                .mass(2.0)
                .inertia([0.01; 3])
                .joint(super::tools::RAIL)
                .limits([-0.1, 0.1])
                .actuated(),
        );
        scene.initial.v = vec![12.0];
        let mut simulator = simulator(&scene, Fidelity::Isolated, integrator);
        let cut = pieces(&simulator, 4);
        assert!(cut[0] > 1, "{cut:?}");
        check_gradient("a limit in pieces", &mut simulator, 4, 2, 1e-6);
    }
}

/// A light plate of 30 cm flat over a wall in water, which comes at it by 0.6 of the gap in the step.
fn closing(gap: f64, integrator: Integrator) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    let rail = Joint::Prismatic {
        axis: [1.0, 0.0, 0.0],
    };
    scene.add_wall([0.0; 3], [1.0, 0.0, 0.0]);
    let plate = Body::new(Shape::cuboid([0.04, 0.3, 0.3]).faces(320)).density(100.0);
    scene.add(plate.at([0.02 + gap, 0.0, 0.0]).joint(rail).actuated());
    scene.time_step = 0.02;
    scene.initial.v = vec![-0.6 * gap / scene.time_step];
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .films(false)
        .integrator(integrator)
        .tolerance(1e-13);
    Simulator::new(&scene, settings).unwrap()
}

/// The inertia of what closes grows as the gap shrinks; where it changes by more than a quarter in the step, that is cut.
#[test]
fn a_stage_that_is_too_long_is_cut() {
    for integrator in [Integrator::MomentumEuler, Integrator::Midpoint] {
        let mut cuts = Vec::new();
        for gap in [0.4, 0.2, 0.1, 0.06, 0.04, 0.03] {
            let mut simulator = closing(gap, integrator);
            cuts.push(pieces(&simulator, 1)[0]);
            println!("{integrator:?}, gap {gap} m: pieces {cuts:?}");
            check_gradient("closing in water", &mut simulator, 1, 2, 1e-6);
        }
        assert!(cuts[0] == 1 && cuts[5] > 1, "{cuts:?}");
    }
}

/// The tangent of a step in pieces against differences, and against its transpose.
#[test]
fn tangent_and_transpose_of_a_step_in_pieces() {
    for integrator in CONTACT_INTEGRATORS {
        let simulator = simulator(&landing(None), Fidelity::Isolated, integrator);
        let stepper = simulator.stepper();
        let input = Input {
            control: DVector::from_fn(6, |i, _| 0.3 * (i as f64 + 1.0).sin()),
            hold: Vec::new(),
        };
        // The step in which the box lands.
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 6)).unwrap();
        let n = rollout.pieces().iter().position(|n| *n > 1).unwrap();
        let state = rollout.states()[n].clone();
        let tree = &simulator.system().tree;
        let nv = tree.velocities();
        let wave = |k: f64| DVector::from_fn(nv, |i, _| (k * i as f64 + k).sin());
        let (dq, dy) = (0.01 * wave(1.3), 0.1 * wave(2.1));
        let du = DVector::from_fn(6, |i, _| (0.7 * i as f64).cos());
        let make = |h: f64| {
            let mut at = state.clone();
            at.q = tree.integrate(&at.q, &(h * &dq));
            at.y += h * &dy;
            let e = stepper.linearise(&at.q, 0.0).unwrap();
            let v = stepper.velocity(&e, &at).unwrap();
            let input = Input {
                control: &input.control + h * &du,
                ..input.clone()
            };
            stepper.step(&e, &at, &v, &input).unwrap()
        };
        let (_, record) = make(0.0);
        assert!(record.pieces() > 1);
        let step = stepper.linearise_step(&record).unwrap();
        let column = |x: &DVector<f64>| DMatrix::from_column_slice(x.len(), 1, x.as_slice());
        let along = StateTangents {
            q: column(&dq),
            y: column(&dy),
        };
        let inputs = InputTangents {
            control: column(&du),
            ..InputTangents::zeros(6, 1)
        };
        let dv = step.velocity_jvp(&along, &inputs).unwrap();
        let tangent = step.jvp(&along, &dv, &inputs).unwrap();
        // Momenta, which need no chart.
        let h = 1e-6;
        let differences = (make(h).0.y - make(-h).0.y) / (2.0 * h);
        let error = (&tangent.y - &differences).norm() / differences.norm();
        println!("{integrator:?}: {} pieces, {error:.1e}", record.pieces());
        assert!(error < 1e-6, "{error:e}");
        let bar = StateBar {
            q: wave(0.4),
            y: wave(0.9),
        };
        let back = step.state_vjp(&bar).unwrap();
        let forth = bar.q.dot(&tangent.q.column(0)) + bar.y.dot(&tangent.y.column(0));
        let back = back.state.q.dot(&dq) + back.state.y.dot(&dy) + back.control.dot(&du);
        assert!((forth - back).abs() < 1e-10 * forth.abs(), "{forth} {back}");
    }
}

/// The parameters of contact through pieces, where the stiffness of the law rises with their number.
#[test]
fn stiffness_through_pieces() {
    let mut scene = touching(0.0);
    scene.gravity = [0.0; 3];
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let ball = Body::new(Shape::sphere(0.05)).density(1000.0);
    scene.add(ball.at([0.0, 0.0, 0.2]));
    scene.initial.v = vec![3.0, 0.0, -20.0, 0.0, 0.0, 0.0];
    let simulator = simulator(&scene, Fidelity::Isolated, Integrator::MomentumEuler);
    let run = |simulator: &Simulator| simulator.rollout(&Controls::zeros(simulator, 3)).unwrap();
    let rollout = run(&simulator);
    assert!(rollout.summary().most_pieces > 1);
    for (name, change) in [("contact.stiffness", 1e-4), ("contact.friction", 1e-5)] {
        let mut seed = rollout.zero_cotangents();
        seed.positions[(2, 3)] = 1.0;
        seed.positions[(0, 3)] = 0.5;
        let read = |simulator: &Simulator| {
            let at = run(simulator).samples()[3].poses[0].translation;
            at.z + 0.5 * at.x
        };
        let value = simulator.parameters().get(name).unwrap();
        let h = change * value;
        let at = |x: f64| {
            let mut other = simulator.clone();
            let mut parameters = simulator.parameters().clone();
            parameters.set(name, x).unwrap();
            other.set_parameters(parameters).unwrap();
            read(&other)
        };
        let difference = (at(value + h) - at(value - h)) / (2.0 * h);
        let adjoint = rollout.vjp(&seed).unwrap().parameters.get(name).unwrap();
        let error = (adjoint - difference).abs() / difference.abs();
        println!("{name}: {adjoint:.6e}, {difference:.6e}: {error:.1e}");
        assert!(error < 1e-5, "{name}: {adjoint} is not {difference}");
    }
}
