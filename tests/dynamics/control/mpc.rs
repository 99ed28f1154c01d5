//! Model-predictive control: a vehicle that holds its hand on a point in a current that its model doesn't know.

use super::{hand, solve, vehicle};
use crate::support::root;
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{Cost, IlqrSettings, IlqrStop, Mpc, MpcSettings, Problem, terms};
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
