//! What can't be is refused, with its place and what would be right.

use super::{solve, vehicle};
use crate::support::says;
use hydrograd::optimize::{
    Cost, CostPoint, CustomCost, Guess, IlqrProgress, IlqrSettings, IlqrStop, Mpc, MpcSettings,
    Problem, Quadratic, Target, Term, Track, Tracking, ilqr, terms,
};
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::{Observation, Policy};
use hydrograd::{Error, Fidelity, Result, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

fn simulator() -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(&vehicle([0.0; 3]), settings).unwrap()
}

#[track_caller]
fn refused(simulator: &Simulator, problem: &Problem, guess: Guess, words: &[&str]) {
    let start = simulator.initial().unwrap();
    let settings = IlqrSettings {
        iterations: 1,
        ..IlqrSettings::default()
    };
    let made = ilqr(simulator, &start, problem, guess, &settings, |_| {
        ControlFlow::Continue(())
    });
    says(made.err().expect("an error"), words);
}

#[test]
fn problems_that_cannot_be() {
    let sim = simulator();
    let effort = || Cost::default().running(terms::effort(1.0));
    let with = |term: Term| Problem::new(5, effort().running(term));
    let last = |term: Term| Problem::new(5, effort().last(term));
    let zero = || vec![0.0; 8];
    let cases: Vec<(Problem, Vec<&str>)> = vec![
        (Problem::new(0, effort()), vec!["knots", "at least 1"]),
        (
            Problem::new(5, effort()).hold(0),
            vec!["hold", "at least 1"],
        ),
        (
            Problem::new(6_000_000, effort()),
            vec!["knots · hold", "at most 5000000"],
        ),
        (
            Problem::new(usize::MAX, effort()).hold(2),
            vec!["knots · hold", "at most 5000000"],
        ),
        (
            Problem::new(5, effort()).limits([1.0], [-1.0]),
            vec![
                "limits of control 0",
                "lower 1 and upper -1",
                "wrong way round",
            ],
        ),
        (
            Problem::new(5, effort()).limits([f64::NAN], []),
            vec!["lower", "NaN"],
        ),
        (
            Problem::new(5, effort()).limits([], [1.0, 2.0]),
            vec!["upper", "2 numbers", "8"],
        ),
        (
            Problem {
                previous: Some(vec![1.0]),
                ..Problem::new(5, effort())
            },
            vec!["previous", "8 finite"],
        ),
        (
            with(terms::position("foot", [0.0; 3], 1.0)),
            vec!["running term 1", "\"foot\"", "hand", "lower"],
        ),
        (
            with(terms::position("hand", [0.0; 2], 1.0)),
            vec!["target", "3 finite"],
        ),
        (
            with(terms::position("hand", [0.0, f64::NAN, 0.0], 1.0)),
            vec!["target", "NaN"],
        ),
        (
            with(terms::position("hand", [0.0; 3], -1.0)),
            vec!["weights", "not negative"],
        ),
        (
            with(terms::point(
                "hand",
                [f64::INFINITY, 0.0, 0.0],
                [0.0; 3],
                1.0,
            )),
            vec!["point", "inf"],
        ),
        (
            with(terms::velocity(zero(), [1.0, 2.0])),
            vec!["velocity", "weights", "8"],
        ),
        (
            with(terms::velocity([0.0; 3], 1.0)),
            vec!["velocity", "8 finite"],
        ),
        (
            with(terms::configuration(vec![0.0; 9], 1.0)),
            vec!["configuration", "quaternion"],
        ),
        (
            with(terms::observable("warmth", [0], 0.0, 1.0)),
            vec!["warmth", "momentum"],
        ),
        (
            with(terms::observable("rotations", [0], 0.0, 1.0)),
            vec!["rotations", "orientation"],
        ),
        (
            with(terms::observable("angular_momentum", [999], 0.0, 1.0)),
            vec!["entries", "under"],
        ),
        (last(terms::effort(1.0)), vec!["last term 0", "running"]),
        (
            last(terms::control_change(1.0)),
            vec!["last term 0", "running"],
        ),
    ];
    for (problem, words) in cases {
        refused(&sim, &problem, Guess::Zero, &words);
    }
    let problem = Problem::new(5, effort());
    refused(
        &sim,
        &problem,
        Guess::Controls(&DMatrix::zeros(8, 4)),
        &["guess", "8 × 4", "8 × 5"],
    );
    let bad = DMatrix::from_element(8, 5, f64::NAN);
    refused(&sim, &problem, Guess::Controls(&bad), &["guess", "finite"]);
    let mut scene = Scene::new(Fluid::none());
    scene.add(Body::dry().mass(1.0).inertia([1.0; 3]));
    let alone = Simulator::new(&scene, Settings::default()).unwrap();
    refused(&alone, &problem, Guess::Zero, &["controlled", "actuated"]);
    says(
        Target::table(vec![], vec![]).unwrap_err(),
        &["at least one row"],
    );
    says(
        Target::table(vec![1.0, 0.0], vec![vec![], vec![]]).unwrap_err(),
        &["grow"],
    );
}

#[test]
fn settings_that_cannot_be() {
    let sim = simulator();
    let start = sim.initial().unwrap();
    let problem = Problem::new(5, Cost::default().running(terms::effort(1.0)));
    let base = IlqrSettings::default();
    for (settings, word) in [
        (
            IlqrSettings {
                iterations: 0,
                ..base
            },
            "iterations",
        ),
        (IlqrSettings { trials: 0, ..base }, "trials"),
        (
            IlqrSettings {
                tolerance: -1.0,
                ..base
            },
            "tolerance",
        ),
        (
            IlqrSettings {
                regularisation: f64::NAN,
                ..base
            },
            "regularisation",
        ),
        (
            IlqrSettings {
                target: Some(f64::NAN),
                ..base
            },
            "target",
        ),
    ] {
        let made = ilqr(&sim, &start, &problem, Guess::Zero, &settings, |_| {
            ControlFlow::Continue(())
        });
        says(made.err().expect("an error"), &["ilqr settings", word]);
    }
    let base = MpcSettings::default();
    for (settings, word) in [
        (MpcSettings { every: 0, ..base }, "every"),
        (MpcSettings { every: 6, ..base }, "at most 5"),
        (
            MpcSettings {
                iterations: 0,
                ..base
            },
            "iterations",
        ),
    ] {
        says(
            Mpc::new(&sim, &problem, settings).err().expect("an error"),
            &["mpc settings", word],
        );
    }
    let mut mpc = Mpc::new(&sim, &problem, base).unwrap();
    let (q, v) = sim.start();
    let late = mpc.control(1.0, q, v).unwrap();
    assert_eq!(late.len(), 8);
    says(
        mpc.control(0.5, q, v).unwrap_err(),
        &["mpc: time", "0.5", "reset"],
    );
    says(
        mpc.control(f64::NAN, q, v).unwrap_err(),
        &["mpc: time", "NaN"],
    );
    let mut other = Scene::new(Fluid::fresh_water());
    other.add(Body::new(Shape::sphere(0.1)).density(998.0).thruster());
    let other = Simulator::new(&other, Settings::default()).unwrap();
    let at = other.initial().unwrap();
    let run = mpc.run(&other, &at, 3, &problem.cost, |_| ControlFlow::Continue(()));
    says(
        run.err().expect("an error"),
        &["mpc: plant", "and 6 controls", "and 8 controls"],
    );
    let longer = Problem::new(7, problem.cost.clone());
    says(
        mpc.set_model(&sim, &longer).unwrap_err(),
        &["mpc: model", "7 steps of a plan", "5 steps of a plan"],
    );
}

/// Once there is a plan too, states that can't be have no controls, and move no clock.
#[test]
fn states_that_cannot_be() {
    let sim = simulator();
    let problem = Problem::new(5, Cost::default().running(terms::effort(1.0)));
    let mut mpc = Mpc::new(&sim, &problem, MpcSettings::default()).unwrap();
    let (q, v) = sim.start();
    mpc.control(0.0, q, v).unwrap();
    let with = |x: &DVector<f64>, i: usize, value: f64| {
        let mut out = x.clone();
        out[i] = value;
        out
    };
    let cases = [
        (with(q, 0, f64::NAN), v.clone(), ["mpc: q", "NaN"]),
        (q.clone(), with(v, 3, f64::INFINITY), ["mpc: v", "inf"]),
        (with(q, 3, 2.0), v.clone(), ["mpc: q of body", "length 2"]),
        (DVector::zeros(3), v.clone(), ["mpc: q", "9 finite"]),
    ];
    for (q, v, words) in &cases {
        says(mpc.control(sim.time_step(), q, v).unwrap_err(), words);
    }
    assert_eq!(mpc.replans().len(), 1);
    let next = mpc.control(sim.time_step(), q, v).unwrap();
    assert!(next.iter().all(|u| u.is_finite()));
}

#[test]
fn feedback_of_other_sizes() {
    let sim = simulator();
    let problem = Problem::new(5, Cost::default().running(terms::effort(1.0)));
    let tracking = solve(&sim, &problem, &IlqrSettings::default()).tracking();
    let (q, v) = sim.start();
    let seen = Observation {
        step: 0,
        time: 0.0,
        time_step: 0.01,
        q,
        v,
        mode: 0,
    };
    for count in [2, 9] {
        let found = tracking.act_vjp(&seen, &DVector::zeros(count));
        let given = format!("got {count} numbers");
        let words = ["control_bar", given.as_str(), "must be 8"];
        says(found.expect_err("an error"), &words);
    }
    let again = Tracking::of(tracking.track().clone()).unwrap();
    let moved = v.map(|x| x + 0.1);
    let controls = |of: &Tracking| of.control(2, q, &moved).unwrap();
    assert_eq!(controls(&again), controls(&tracking));
    let with = |change: &dyn Fn(&mut Track)| {
        let mut track = tracking.track().clone();
        change(&mut track);
        Tracking::of(track).err().expect("an error")
    };
    let rest = "8 controls, 9 coordinates and 8 velocities";
    for (error, what) in [
        (with(&|t| t.hold = 2), "states"),
        (with(&|t| t.hold = 0), "knots and hold"),
        (with(&|t| t.gains.truncate(4)), "gains"),
        (with(&|t| t.states[3].1 = DVector::zeros(7)), "states"),
        (with(&|t| t.controls = DMatrix::zeros(7, 5)), "controls"),
        (with(&|t| t.lower[1] = f64::NAN), "limits"),
        (with(&|t| t.start = f64::NAN), "start"),
    ] {
        says(error, &["tracking of a plan", what, rest]);
    }
}

struct Wrong(&'static str);

impl CustomCost for Wrong {
    fn value(&self, _: &CostPoint) -> Result<f64> {
        match self.0 {
            "fails" => Err(Error::input("my cost", 1, "must be something else")),
            "nan" => Ok(f64::NAN),
            _ => Ok(1.0),
        }
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let mut out = Quadratic::zeros(16, if self.0 == "shape" { 3 } else { 8 });
        out.value = self.value(at)?;
        out.x[0] = if self.0 == "slope" {
            f64::INFINITY
        } else {
            0.0
        };
        Ok(out)
    }
}

/// A cost whose gradient has the wrong sign.
struct Uphill;

impl CustomCost for Uphill {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        Ok((at.sample().q[0] - 1.0).powi(2))
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let mut out = Quadratic::zeros(16, at.control.map_or(8, |u| u.len()));
        out.value = self.value(at)?;
        out.x[0] = -2.0 * (at.sample().q[0] - 1.0);
        out.xx[(0, 0)] = 2.0;
        Ok(out)
    }
}

/// Where no step lowers the cost that is what the plan says, and not that its gradient is zero.
#[test]
fn a_gradient_that_leads_uphill_ends_stuck() {
    let sim = simulator();
    let cost = Cost::default()
        .running(terms::effort(1e-3))
        .running(terms::custom(Uphill));
    let start = sim.initial().unwrap();
    let (problem, settings) = (Problem::new(5, cost), IlqrSettings::default());
    let on = |_: &IlqrProgress| ControlFlow::Continue(());
    let plan = ilqr(&sim, &start, &problem, Guess::Zero, &settings, on).unwrap();
    assert_eq!(plan.stop, IlqrStop::Stuck, "{:?}", plan.costs);
    assert!(plan.gradient > 0.0);
}

/// A cost that draws to a place, and can't be told near it: by the user's own fault, or not.
struct Near {
    own: bool,
}

impl CustomCost for Near {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        let x = at.sample().q[0];
        match (x > 0.01, self.own) {
            (true, true) => Err(Error::Controller {
                source: "of my own".into(),
            }),
            (true, false) => Err(Error::input("my cost", x, "must be farther off")),
            (false, _) => Ok(1e4 * (x - 0.02).powi(2)),
        }
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let mut out = Quadratic::zeros(16, at.control.map_or(8, |u| u.len()));
        out.value = self.value(at)?;
        out.x[0] = 2e4 * (at.sample().q[0] - 0.02);
        out.xx[(0, 0)] = 2e4;
        Ok(out)
    }
}

#[test]
fn what_a_cost_raises_ends_the_search_and_a_trial_that_fails_does_not() {
    let sim = simulator();
    let start = sim.initial().unwrap();
    let settings = IlqrSettings {
        iterations: 3,
        ..IlqrSettings::default()
    };
    let made = |own: bool| {
        let cost = Cost::default()
            .running(terms::effort(1e-6))
            .running(terms::custom(Near { own }));
        let on = |_: &IlqrProgress| ControlFlow::Continue(());
        let problem = Problem::new(5, cost);
        ilqr(&sim, &start, &problem, Guess::Zero, &settings, on)
    };
    let plan = made(false).unwrap();
    assert!(plan.cost() < plan.costs[0], "{:?}", plan.costs);
    let error = made(true).err().expect("an error");
    assert!(matches!(error, Error::Controller { .. }), "{error}");
}

#[test]
fn costs_of_ones_own_that_cannot_be() {
    let sim = simulator();
    for (name, words) in [
        ("fails", vec!["my cost", "something else"]),
        ("nan", vec!["cost at knot 0", "value", "NaN"]),
        (
            "shape",
            vec!["custom cost at knot 0", "gradient by u", "(8, 1)"],
        ),
        ("slope", vec!["cost at knot 0", "gradient by x", "inf"]),
    ] {
        let cost = Cost::default().running(terms::custom(Wrong(name)));
        refused(&sim, &Problem::new(5, cost), Guess::Zero, &words);
    }
}
