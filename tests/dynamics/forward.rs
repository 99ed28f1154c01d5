//! Forward mode of whole rollouts: its parts agree with one another, with the reverse sweep, and on any number of threads.

use crate::galilean::{STEPS, collision, drifting, mechanism, settings};
use crate::support::{
    INTEGRATORS, example,
    forward::{LIMIT, OBSERVED, check_forward, displacement},
    says,
};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::simulate::{PushThenLock, Variables};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DMatrix;
use std::ops::ControlFlow;

fn coins(integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let settings = settings.integrator(integrator).tolerance(1e-13);
    Simulator::new(&example("coins"), settings).unwrap()
}

fn run(simulator: &Simulator, steps: usize) -> Rollout {
    let controls = Controls::zeros(simulator, steps);
    simulator.rollout(&controls).unwrap()
}

/// Columns of Jacobians are tangents, and the product of all steps' is that of the whole.
#[test]
fn jacobians_are_tangents_and_products_of_steps() {
    for integrator in INTEGRATORS {
        let simulator = coins(integrator);
        let rollout = run(&simulator, 4);
        let nv = simulator.system().tree.velocities();
        let names = ["fluid.density"];
        let variables = Variables {
            parameters: names.map(String::from).into(),
            initial_q: true,
            initial_v: true,
            ..Variables::default()
        };
        let found = rollout.jacobian(&variables, &["q", "v"], &[4, 1]).unwrap();
        let mut along = rollout.zero_displacement();
        along.parameters.set(names[0], 1.0).unwrap();
        let tangent = &rollout.jvp(&[along], &[]).unwrap()[0];
        let column = |m: &DMatrix<f64>, at: usize| m.column(0).rows(at * nv, nv).into_owned();
        for (place, state) in [4, 1].into_iter().enumerate() {
            for (found, exact) in [(&found[0], &tangent.q), (&found[1], &tangent.v)] {
                let error = (column(found, place) - exact.column(state)).norm();
                assert!(error <= 1e-12 * exact.norm(), "{integrator:?}: {error:e}");
            }
        }
        let mut product = DMatrix::identity(2 * nv, 2 * nv);
        let mut by_parameter = DMatrix::zeros(2 * nv, 1);
        for step in rollout.step_jacobians(&names).unwrap() {
            by_parameter = &step.state * by_parameter + step.parameters;
            product = step.state * product;
        }
        let whole = rollout.jacobians_with(&names).unwrap();
        let error = (&whole.state - &product).norm() / product.norm();
        let other = (&whole.parameters - &by_parameter).norm() / by_parameter.norm();
        println!("{integrator:?}: {error:.1e} {other:.1e}");
        assert!(
            error < 1e-10 && other < 1e-9,
            "{integrator:?}: {error:e} {other:e}"
        );
        for (rows, found) in [(0, &found[0]), (nv, &found[1])] {
            let exact = whole.state.rows(rows, nv);
            let error = (found.view((0, 1), (nv, 2 * nv)) - exact).norm() / exact.norm();
            assert!(error < 1e-10, "{integrator:?}: {error:e}");
        }
    }
}

/// On one thread and on three.
#[test]
fn numbers_are_the_same_on_any_number_of_threads() {
    let simulator = coins(Integrator::Rk2);
    let made = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let rollout = run(&simulator, 6);
            let along = [11, 12].map(|seed| displacement(&rollout, seed));
            let tangents = rollout.jvp(&along, &OBSERVED).unwrap();
            (
                rollout.step_jacobians(&["fluid.density"]).unwrap(),
                tangents,
            )
        })
    });
    assert!(made[0] == made[1]);
}

/// A joint that a motion drives, and one that the controller pushes and then holds.
#[test]
fn driven_and_held_joints() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let rail = || Joint::Prismatic {
        axis: [1.0, 0.0, 0.0],
    };
    let ball = |name: &str| Body::new(Shape::sphere(0.1)).named(name).density(1100.0);
    scene.add(ball("pushed").joint(rail()).actuated());
    let swing = Motion::Sine {
        offset: 0.0,
        amplitude: 0.05,
        frequency: 1.0,
        phase: 0.3,
    };
    scene.add(
        ball("swings")
            .at([0.0, 0.4, 0.0])
            .joint(rail())
            .driven([swing]),
    );
    scene.add(ball("free").at([0.0, -0.4, 0.0]));
    scene.time_step = 0.02;
    // Of what is driven and what isn't only the latter drifts.
    let currents = [[0.0; 3], [0.3, 0.2, -0.1]];
    for (integrator, current) in INTEGRATORS
        .into_iter()
        .flat_map(|i| currents.map(|c| (i, c)))
    {
        scene.fluid.current = current;
        let settings = Settings::default().fidelity(Fidelity::Reduced);
        let mut simulator = Simulator::new(&scene, settings.integrator(integrator)).unwrap();
        simulator.set_policy(Box::new(PushThenLock {
            controls: 1,
            bodies: 3,
            body: 0,
            control: 0,
            q: 0,
            force: 8.0,
            stop_at: 0.02,
            from_above: false,
        }));
        let rollout = run(&simulator, 16);
        assert!(rollout.samples()[15].hold.contains(&true));
        check_forward("driven and held", &simulator, 16, LIMIT);
    }
}

/// Joints, drag, springs, thrusters and contact, in still water and in a current that all may drift along with.
#[test]
fn in_still_water_and_in_a_current() {
    for integrator in INTEGRATORS {
        let solves_contact = integrator.solves_contact();
        for (what, scene) in [("mechanism", mechanism()), ("collision", collision())] {
            if scene.contact.is_some() && !solves_contact {
                continue;
            }
            let moving = drifting(scene.clone());
            for (where_, scene) in [("still", scene), ("in a current", moving)] {
                let simulator = Simulator::new(&scene, settings(integrator)).unwrap();
                let what = format!("{what}, {where_}, {integrator:?}");
                if scene.contact.is_some() {
                    let rollout = run(&simulator, STEPS);
                    let pressed = |n| !rollout.contacts(n, 0.0).unwrap().is_empty();
                    assert!((0..STEPS).any(pressed), "{what}");
                }
                check_forward(&what, &simulator, STEPS, LIMIT);
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let simulator = coins(Integrator::Rk2);
    let rollout = run(&simulator, 2);
    let mut wrong = rollout.zero_displacement();
    wrong.initial.v = wrong.initial.v.push(0.0);
    let refused = |d| {
        rollout
            .jvp(&[rollout.zero_displacement(), d], &[])
            .unwrap_err()
    };
    says(refused(wrong), &["displacements[1].initial.v", "shape"]);
    let mut wrong = rollout.zero_displacement();
    wrong.initial.q[0] = f64::NAN;
    says(refused(wrong), &["displacements[1].initial.q", "finite"]);
    let none = [rollout.zero_displacement()];
    says(rollout.jvp(&none, &["energy"]).unwrap_err(), &["energy"]);
    let variables = Variables::default();
    let error = rollout.jacobian(&variables, &["q"], &[3]).unwrap_err();
    says(error, &["states", "at most 2"]);
    says(rollout.step_jacobians(&["mass"]).unwrap_err(), &["mass"]);
    let stopped = rollout.jvp_with(&none, &[], |_| ControlFlow::Break(()));
    says(stopped.unwrap_err(), &["tangents", "1 of 2 steps"]);
    // No directions and no steps are nothing.
    assert!(rollout.jvp(&[], &[]).unwrap().is_empty());
    let still = run(&simulator, 0);
    let moved = &still
        .jvp(&[still.zero_displacement()], &["positions"])
        .unwrap()[0];
    assert_eq!(moved.q.ncols(), 1);
    assert!(still.step_jacobians(&[]).unwrap().is_empty());
}
