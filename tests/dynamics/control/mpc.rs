//! Model-predictive control: a vehicle that holds its hand on a point in a current that its model doesn't know.

use super::{hand, solve, vehicle};
use crate::support::root;
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{Cost, IlqrSettings, IlqrStop, Mpc, MpcSettings, Problem, terms};
use hydrograd::scene::{Body, Fluid, Joint, Motion, Scene};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

fn simulator(current: [f64; 3], fidelity: Fidelity, time_step: f64) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(Integrator::Rk2);
    let mut scene = vehicle(current);
    scene.time_step = time_step;
    Simulator::cached(&scene, settings, &root().join("target/cache")).unwrap()
}

const POINT: [f64; 3] = [0.66, 0.0, 0.0];

fn problem() -> Problem {
    let cost = Cost::default()
        .running(terms::position("hand", POINT, 300.0))
        .running(terms::orientation("hull", [0.0; 3], 5.0))
        .running(terms::velocity([0.0; 8], 1.0))
        .running(terms::effort(1e-3))
        .running(terms::control_change(1e-2));
    Problem::new(15, cost).hold(4).limits([-20.0], [20.0])
}

/// Mean distance of the hand from the point over a part of a run, m.
fn off(rollout: &Rollout, from: usize) -> f64 {
    let places = hand(rollout);
    let point = DVector::from_column_slice(&POINT);
    let each = places[from..].iter().map(|p| (p - &point).norm());
    each.sum::<f64>() / (places.len() - from) as f64
}

#[test]
fn planning_again_holds_a_point_in_a_current_that_the_model_does_not_know() {
    let model = simulator([0.0; 3], Fidelity::Isolated, 0.02);
    // Finer steps, bodies that feel each other, and a current.
    let plant = simulator([0.15, 0.1, -0.05], Fidelity::Auto, 0.01);
    let (problem, steps) = (problem(), 240);
    let settings = MpcSettings {
        every: 4,
        iterations: 2,
        ..MpcSettings::default()
    };
    let start = plant.initial().unwrap();
    let mut mpc = Mpc::new(&model, &problem, settings).unwrap();
    let mut told = 0;
    let run = mpc
        .run(&plant, &start, steps, &problem.cost, |p| {
            told += 1;
            assert_eq!((p.step + 1, p.steps), (told, steps));
            ControlFlow::Continue(())
        })
        .unwrap();
    // The first plan alone, over the same time.
    let mut long = problem.clone();
    long.knots = 30;
    let plan = solve(&model, &long, &IlqrSettings::default());
    let open = DMatrix::from_fn(8, steps, |i, n| plan.controls[(i, n / 8)]);
    let open = plant
        .rollout(&Controls::from_matrix(&plant, open).unwrap())
        .unwrap();
    let mut tracked = plant.clone();
    tracked.set_policy(Box::new(plan.tracking()));
    let tracked = tracked.rollout(&Controls::zeros(&plant, steps)).unwrap();
    let [with, alone, followed] = [&run.rollout, &open, &tracked].map(|r| off(r, 120));
    let (mean, longest) = run.plan_seconds().unwrap();
    println!(
        "hand off by {:.1} mm on average with {} plans, {:.1} mm by the first one's feedback, {:.1} mm by its controls; plans take {:.1} ms, at most {:.1} ms; cost {:.3}",
        1e3 * with,
        run.replans.len(),
        1e3 * followed,
        1e3 * alone,
        1e3 * mean,
        1e3 * longest,
        run.cost
    );
    assert!(with < 0.25 * alone, "{with} {alone}");
    assert_eq!(run.replans.len(), steps / 8);
    assert!(
        run.replans[1..]
            .iter()
            .all(|r| r.iterations <= 2 && r.failure.is_none())
    );
    assert!(run.rates.len() == steps && run.cost > 0.0);
    // One that knows the current does better still.
    let informed = simulator([0.15, 0.1, -0.05], Fidelity::Isolated, 0.02);
    mpc.set_model(&informed, &problem).unwrap();
    mpc.reset();
    let known = mpc
        .run(&plant, &start, steps, &problem.cost, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
    println!(
        "one that knows the current: {:.1} mm, cost {:.3}",
        1e3 * off(&known.rollout, 120),
        known.cost
    );
    assert!(known.cost < run.cost);
    // To the bit what it was.
    let again = mpc
        .run(&plant, &start, steps, &problem.cost, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(again.rollout.controls(), known.rollout.controls());
}

/// Step by step as a robot would ask, and in two parts: the run's controls to the bit.
#[test]
fn controls_can_be_asked_for_step_by_step() {
    let model = simulator([0.1, 0.0, 0.0], Fidelity::Isolated, 0.02);
    let settings = MpcSettings {
        every: 3,
        iterations: 1,
        first_iterations: 5,
        feedback: false,
        ..MpcSettings::default()
    };
    let (problem, go) = (problem(), |_: &_| ControlFlow::Continue(()));
    let mut mpc = Mpc::new(&model, &problem, settings).unwrap();
    let start = model.initial().unwrap();
    let run = mpc.run(&model, &start, 12, &problem.cost, go).unwrap();
    let most = run.replans.iter().map(|r| r.iterations).max();
    assert!(matches!(most, Some(2..=5)), "{most:?}");
    mpc.reset();
    let mut state = start.clone();
    for n in 0..12 {
        let sample = &run.rollout.samples()[n];
        let control = mpc.control(sample.time, &sample.q, &sample.v).unwrap();
        assert_eq!(control, run.rollout.controls().column(n), "step {n}");
        assert_eq!(
            mpc.control(sample.time, &sample.q, &sample.v).unwrap(),
            control
        );
        state = model.step(&state, &control).unwrap().0;
    }
    assert_eq!(state.q, run.rollout.states()[12].q);
    assert_eq!(mpc.replans().len(), 4);
    assert!(mpc.plan().is_some_and(|p| p.stop != IlqrStop::Stuck));
    mpc.reset();
    let first = mpc.run(&model, &start, 6, &problem.cost, go).unwrap();
    let middle = &first.rollout.states()[6];
    let second = mpc.run(&model, middle, 6, &problem.cost, go).unwrap();
    assert_eq!(second.rollout.states()[6].q, run.rollout.states()[12].q);
    assert_eq!([first.replans.len(), second.replans.len()], [2, 2]);
}

/// Until the next plan the last one's controls are held as it holds them, whatever a model's problem given since does.
#[test]
fn a_plan_keeps_its_knots() {
    let model = simulator([0.1, 0.0, 0.0], Fidelity::Isolated, 0.02);
    let settings = MpcSettings {
        every: 30,
        first_iterations: 2,
        feedback: false,
        ..MpcSettings::default()
    };
    let mut mpc = Mpc::new(&model, &problem(), settings).unwrap();
    let (q, v) = model.start();
    mpc.control(0.0, q, v).unwrap();
    let planned = mpc.plan().unwrap().controls.clone();
    assert!(planned.column(1) != planned.column(5));
    let mut finer = problem().hold(1);
    finer.knots = 60;
    mpc.set_model(&model, &finer).unwrap();
    for step in [5, 18] {
        let control = mpc.control(0.02 * step as f64, q, v).unwrap();
        assert_eq!(control, planned.column(step / 4), "step {step}");
    }
    assert_eq!(mpc.replans().len(), 1);
}

/// A cart on one that a motion shakes, at times of the plant that the model doesn't have: for the model the shaken one is where its own time has it.
#[test]
fn motions_go_by_the_models_clock() {
    let shaken = |time_step: f64| {
        let mut scene = Scene::new(Fluid::none());
        scene.time_step = time_step;
        let body = |name: &str| {
            let axis = [1.0, 0.0, 0.0];
            let body = Body::dry().named(name).mass(1.0).inertia([0.1; 3]);
            body.joint(Joint::Prismatic { axis })
        };
        let shake = Motion::Sine {
            offset: 0.0,
            amplitude: 0.2,
            frequency: 3.0,
            phase: 0.4,
        };
        scene.add(body("shaker").driven([shake]));
        scene.add(body("cart").child_of("shaker").actuated());
        Simulator::new(&scene, Settings::default()).unwrap()
    };
    let (model, plant) = (shaken(0.05), shaken(0.02));
    let cost = Cost::default()
        .running(terms::configuration([0.0; 2], 1.0))
        .running(terms::effort(0.1));
    let problem = Problem::new(10, cost);
    let mut mpc = Mpc::new(&model, &problem, MpcSettings::default()).unwrap();
    let start = plant.initial().unwrap();
    let go = |_: &_| ControlFlow::Continue(());
    let run = mpc.run(&plant, &start, 30, &problem.cost, go).unwrap();
    let failures: Vec<_> = run
        .replans
        .iter()
        .filter_map(|r| r.failure.as_ref())
        .collect();
    assert!(failures.is_empty(), "{failures:?}");
    assert_eq!(run.replans.len(), 12);
}

/// A dry cart on a rail.
fn cart(time_step: f64) -> Simulator {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = time_step;
    let axis = [1.0, 0.0, 0.0];
    let cart = Body::dry().mass(2.0).inertia([0.1; 3]);
    scene.add(cart.joint(Joint::Prismatic { axis }).actuated());
    Simulator::new(&scene, Settings::default()).unwrap()
}

/// A cart is stopped with smooth controls.
fn stop() -> Cost {
    Cost::default()
        .running(terms::velocity([0.0], 5.0))
        .running(terms::effort(1e-2))
        .running(terms::control_change(2e-2))
}

/// A run from another state at the time of the last one's decision has controls of its own; one that goes on within a step of the model keeps those that are held.
#[test]
fn runs_answer_to_where_they_start() {
    let go = |_: &_| ControlFlow::Continue(());
    let problem = Problem::new(10, stop());
    let (model, finer) = (cart(0.1), cart(0.05));
    let at = |v: f64| {
        let (q, v) = (DVector::zeros(1), DVector::from_element(1, v));
        model.state(0, &q, &v).unwrap()
    };
    for feedback in [true, false] {
        let settings = MpcSettings {
            every: 5,
            feedback,
            ..MpcSettings::default()
        };
        let new = || Mpc::new(&model, &problem, settings).unwrap();
        let mut mpc = new();
        let one = |mpc: &mut Mpc, v: f64| {
            let run = mpc.run(&model, &at(v), 1, &problem.cost, go).unwrap();
            run.rollout.controls()[(0, 0)]
        };
        let (there, back) = (one(&mut mpc, 1.0), one(&mut mpc, -1.0));
        assert!(
            there < -1.0 && (there + back).abs() < 1e-6,
            "{there} {back}"
        );
        assert_eq!(back, one(&mut new(), -1.0));
        // What was asked for by itself is no run's either.
        let mut asked = new();
        asked
            .control(0.0, &at(1.0).q, &DVector::from_element(1, 1.0))
            .unwrap();
        assert_eq!(back, one(&mut asked, -1.0));

        let start = finer.state(0, &DVector::zeros(1), &DVector::from_element(1, 1.0));
        let start = start.unwrap();
        let whole = new().run(&finer, &start, 6, &problem.cost, go).unwrap();
        let mut mpc = new();
        let first = mpc.run(&finer, &start, 3, &problem.cost, go).unwrap();
        let middle = &first.rollout.states()[3];
        let second = mpc.run(&finer, middle, 3, &problem.cost, go).unwrap();
        let parts = [first, second].map(|run| run.rollout.controls().clone());
        for (n, all) in whole.rollout.controls().iter().enumerate() {
            assert_eq!(*all, parts[n / 3][(0, n % 3)], "step {n}");
        }
        assert_eq!(mpc.replans().len(), 1);
    }
}

/// Changes of controls cost a run what they cost its plan: a whole knot each, the first one's from the controls before.
#[test]
fn a_run_costs_what_its_plan_does() {
    let go = |_: &_| ControlFlow::Continue(());
    let settings = MpcSettings {
        every: 12,
        feedback: false,
        ..MpcSettings::default()
    };
    let model = cart(0.1);
    let start = |of: &Simulator| {
        let v = DVector::from_element(1, 1.0);
        of.state(0, &DVector::zeros(1), &v).unwrap()
    };
    let controls = Cost::default()
        .running(terms::effort(1e-2))
        .running(terms::control([-3.0], 0.1))
        .running(terms::control_change(2e-2));
    // States between knots count in a run only: with more than a step a knot, controls alone.
    for (hold, steps, cost) in [
        (1, 1, stop().last(terms::velocity([0.0], 10.0))),
        (4, 1, controls.clone()),
        (4, 2, controls),
    ] {
        let mut problem = Problem::new(12 / hold, cost).hold(hold);
        for previous in [None, Some(vec![20.0])] {
            problem.previous = previous;
            let mut mpc = Mpc::new(&model, &problem, settings).unwrap();
            let plant = cart(0.1 / f64::from(steps));
            let count = 12 * steps as usize;
            let run = mpc.run(&plant, &start(&plant), count, &problem.cost, go);
            let run = run.unwrap();
            let planned = mpc.plan().unwrap().cost();
            assert!(
                (run.cost / planned - 1.0).abs() < 1e-9,
                "{} {planned}: {hold} steps a knot, {steps} of the plant",
                run.cost
            );
            assert_eq!(run.replans.len(), 1);
        }
    }
}
