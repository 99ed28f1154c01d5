//! Linear systems, for which the best controls are known.

use super::{by_sweep, open_gradient, solve, tight};
use crate::support::simulator;
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{Cost, Guess, IlqrStop, Problem, ilqr, terms};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Spring};
use hydrograd::{Fidelity, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

const REST: f64 = 0.5;

/// Three dry masses on a rail with springs and dampers between them, the first and the last driven.
fn masses() -> Simulator {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.05;
    let axis = [1.0, 0.0, 0.0];
    for k in 0..3 {
        let body = Body::dry()
            .named(format!("mass {k}"))
            .mass(1.0 + f64::from(k));
        let body = body.inertia([0.1; 3]).joint(Joint::Prismatic { axis });
        let body = body.at([REST * f64::from(k), 0.0, 0.0]);
        scene.add(if k == 1 { body } else { body.actuated() });
        if k > 0 {
            let spring = Spring::new(format!("mass {}", k - 1));
            let spring = spring.to(format!("mass {k}"), [0.0; 3]);
            scene.add_force(spring.stiffness(20.0).damping(0.3).rest_length(REST).into());
        }
    }
    let mut out = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let start = DVector::from_vec(vec![0.05, -0.1, 0.08]);
    out.set_start(start, DVector::from_vec(vec![0.2, 0.1, -0.3]))
        .unwrap();
    out
}

/// One step of (q, v) under controls.
fn step(simulator: &Simulator, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
    let nv = x.len() / 2;
    let (q, v) = (x.rows(0, nv).into_owned(), x.rows(nv, nv).into_owned());
    let state = simulator.state(0, &q, &v).unwrap();
    let (_, record) = simulator.step(&state, u).unwrap();
    let sample = &record.rollout().samples()[1];
    DVector::from_iterator(2 * nv, sample.q.iter().chain(&sample.v).copied())
}

/// A and B, from steps alone: the system is linear.
fn system(simulator: &Simulator) -> (DMatrix<f64>, DMatrix<f64>) {
    let unit = |n: usize, i: usize| DVector::from_fn(n, |k, _| if k == i { 0.01 } else { 0.0 });
    let columns = |n: usize, of: &dyn Fn(DVector<f64>) -> DVector<f64>| {
        let each: Vec<_> = (0..n).map(|i| of(unit(n, i)) / 0.01).collect();
        DMatrix::from_columns(&each)
    };
    let a = columns(6, &|x| step(simulator, &x, &DVector::zeros(2)));
    let b = columns(2, &|u| step(simulator, &DVector::zeros(6), &u));
    (a, b)
}

fn start(simulator: &Simulator) -> DVector<f64> {
    let (q, v) = simulator.start();
    DVector::from_iterator(6, q.iter().chain(v).copied())
}

const WEIGHTS: [f64; 3] = [3.0, 1.0, 2.0];

fn cost() -> Cost {
    Cost::default()
        .running(terms::configuration([0.0; 3], WEIGHTS))
        .running(terms::velocity([0.0; 3], 0.1))
        .running(terms::effort(0.05))
        .last(terms::configuration([0.0; 3], 5.0))
        .last(terms::velocity([0.0; 3], 2.0))
}

fn diagonal(q: [f64; 3], v: f64, scale: f64) -> DMatrix<f64> {
    DMatrix::from_fn(6, 6, |i, j| match i == j {
        true => scale * if i < 3 { q[i] } else { v },
        false => 0.0,
    })
}

/// Controls, feedback and cost of iLQR are those of Riccati's recursion, to 1e-10.
#[test]
fn a_linear_system_has_the_controls_of_riccati() {
    let simulator = masses();
    let (a, b) = system(&simulator);
    let (knots, dt) = (40, simulator.time_step());
    let q = diagonal(WEIGHTS, 0.1, dt);
    let r = 0.05 * dt * DMatrix::<f64>::identity(2, 2);
    let mut p = diagonal([5.0; 3], 2.0, 1.0);
    let mut gains = Vec::new();
    for _ in 0..knots {
        let pa = &p * &a;
        let gain = (&r + b.tr_mul(&(&p * &b)))
            .lu()
            .solve(&b.tr_mul(&pa))
            .unwrap();
        p = &q + a.tr_mul(&(pa - &p * &b * &gain));
        gains.push(gain);
    }
    gains.reverse();
    let mut x = start(&simulator);
    let best = x.dot(&(&p * &x));
    let problem = Problem::new(knots, cost());
    let plan = solve(&simulator, &problem, &tight());
    println!(
        "{:?} after {} iterations: {:?}",
        plan.stop, plan.iterations, plan.costs
    );
    assert_eq!(plan.stop, IlqrStop::Stationary);
    assert!(plan.iterations <= 2);
    assert!(
        (plan.cost() / best - 1.0).abs() < 1e-11,
        "{} {best}",
        plan.cost()
    );
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (k, gain) in gains.iter().enumerate() {
        let u = -gain * &x;
        worst = worst.max((&u - plan.controls.column(k)).amax());
        largest = largest.max(u.amax());
        let off = (&plan.gains[k] + gain).amax() / gain.amax();
        assert!(off < 1e-10, "gain of knot {k}: {off:e}");
        x = &a * x + &b * u;
    }
    println!("controls differ by {:.1e} of {largest}", worst / largest);
    assert!(worst < 1e-10 * largest);
    let gradient = by_sweep(&plan, &problem);
    let none = problem.objective(&simulator).unwrap();
    let controls = hydrograd::Controls::zeros(&simulator, knots);
    let first = simulator
        .rollout(&controls)
        .unwrap()
        .gradient(&none)
        .unwrap();
    let relative = gradient.amax() / first.controls.amax();
    println!("gradient at the end {relative:.1e} of that at the start");
    assert!(relative < 1e-10);
}

/// Knots of three steps, a price on changes of the controls, a moving target: against the normal equations of all controls at once.
#[test]
fn knots_of_several_steps_and_changes_of_controls() {
    let simulator = masses();
    let (a, b) = system(&simulator);
    let (knots, hold) = (12, 3);
    let times: Vec<f64> = (0..5).map(|k| 0.5 * f64::from(k)).collect();
    let rows = times
        .iter()
        .map(|t| vec![0.1 * t.sin(), 0.0, 0.1])
        .collect();
    let target = hydrograd::optimize::Target::table(times, rows).unwrap();
    let goal = |time: f64| {
        let (k, part) = ((time / 0.5).floor(), (time / 0.5).fract());
        let of = |k: f64| 0.1 * (0.5 * k).sin();
        let end = k >= 4.0;
        let x = if end {
            of(4.0)
        } else {
            of(k) + part * (of(k + 1.0) - of(k))
        };
        DVector::from_vec(vec![x, 0.0, 0.1, 0.0, 0.0, 0.0])
    };
    let cost = Cost::default()
        .running(terms::configuration(target.clone(), WEIGHTS))
        .running(terms::control_change([0.3, 0.1]))
        .running(terms::control([0.2, -0.1], 0.01))
        .last(terms::configuration(target, 4.0));
    let mut problem = Problem::new(knots, cost).hold(hold);
    let duration = hold as f64 * simulator.time_step();
    for previous in [None, Some(vec![0.4, -0.6])] {
        problem.previous = previous.clone();
        let plan = solve(&simulator, &problem, &tight());
        // Rows of residuals √w (M u + c).
        let (mut over, mut into) = (a.clone(), b.clone());
        for _ in 1..hold {
            (over, into) = (&a * over, &a * into + &b);
        }
        let n = 2 * knots;
        let (mut rows, mut right): (Vec<DMatrix<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut add = |matrix: DMatrix<f64>, constant: DVector<f64>, weights: &[f64]| {
            for (i, w) in weights.iter().enumerate() {
                rows.push(w.sqrt() * matrix.rows(i, 1));
                right.push(-w.sqrt() * constant[i]);
            }
        };
        let (mut x, mut by_u) = (start(&simulator), DMatrix::zeros(6, n));
        for k in 0..=knots {
            let scale = if k < knots { duration } else { 1.0 };
            let weights = if k < knots { WEIGHTS } else { [4.0; 3] };
            add(
                by_u.clone(),
                &x - goal(k as f64 * duration),
                &weights.map(|w| w * scale),
            );
            if k == knots {
                break;
            }
            let mut own = DMatrix::zeros(2, n);
            own.view_mut((0, 2 * k), (2, 2)).fill_with_identity();
            let about = DVector::from_vec(vec![-0.2, 0.1]);
            add(own.clone(), about, &[0.01 * duration; 2]);
            let change = [0.3 * duration, 0.1 * duration];
            match (k, &previous) {
                (0, None) => {}
                (0, Some(before)) => add(own, -DVector::from_vec(before.clone()), &change),
                _ => {
                    own.view_mut((0, 2 * k - 2), (2, 2))
                        .copy_from(&-DMatrix::<f64>::identity(2, 2));
                    add(own, DVector::zeros(2), &change);
                }
            }
            let mut next = &over * &by_u;
            let mut column = next.columns_mut(2 * k, 2);
            column += &into;
            (by_u, x) = (next, &over * x);
        }
        let m = DMatrix::from_fn(rows.len(), n, |i, j| rows[i][(0, j)]);
        let c = DVector::from_vec(right);
        let best = m.clone().svd(true, true).solve(&c, 0.0).unwrap();
        let value = (&m * &best - &c).norm_squared();
        let given = DVector::from_column_slice(plan.controls.as_slice());
        let off = (&given - &best).amax() / best.amax();
        println!(
            "{:?}, {} iterations, controls differ by {off:.1e}",
            plan.stop, plan.iterations
        );
        assert!(off < 1e-9);
        assert!(
            (plan.cost() / value - 1.0).abs() < 1e-10,
            "{} {value}",
            plan.cost()
        );
        let gradient = by_sweep(&plan, &problem).amax();
        assert!(gradient < 1e-11, "{gradient:e}");
    }
}

/// Limits hold to the bit, and what they hold presses against them; the rest has no gradient. The problem is convex: no other controls do better.
#[test]
fn limits_hold_exactly() {
    let simulator = masses();
    for limit in [0.3, 0.4] {
        let mut problem = Problem::new(40, cost()).hold(2);
        let free = solve(&simulator, &problem, &tight());
        problem = problem.limits([-limit], [limit]);
        let plan = solve(&simulator, &problem, &tight());
        let gradient = by_sweep(&plan, &problem);
        let (open, held) = open_gradient(&plan, &gradient, -limit, limit);
        println!(
            "limit {limit}: {held} of 80 held, {:?} after {} iterations, gradient {open:.1e}",
            plan.stop, plan.iterations
        );
        assert!(held > 3 && held < 70);
        assert!(free.controls.amax() > limit && free.cost() < plan.cost());
        assert!(open < 1e-9, "{open:e}");
        assert!((plan.gradient - open).abs() < 1e-9);
        for (k, gain) in plan.gains.iter().enumerate() {
            for i in 0..2 {
                let at_limit = plan.controls[(i, k)].abs() == limit;
                assert_eq!(at_limit, gain.row(i).iter().all(|x| *x == 0.0), "{k} {i}");
            }
        }
    }
}

/// Whatever the number of threads.
#[test]
fn the_numbers_are_the_same_for_any_number_of_threads() {
    let simulator = masses();
    let problem = Problem::new(20, cost()).limits([-0.3], [0.3]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| solve(&simulator, &problem, &tight()))
    };
    let (one, many) = (with(1), with(5));
    assert_eq!(one.controls, many.controls);
    assert_eq!(one.gains, many.gains);
    assert_eq!(one.costs, many.costs);
}

/// Told of every iteration, ended when asked, and resumed from there.
#[test]
fn progress_may_end_it_and_a_plan_is_a_start() {
    let simulator = masses();
    let problem = Problem::new(20, cost()).limits([-0.3], [0.3]);
    let state = simulator.initial().unwrap();
    let mut told = Vec::new();
    let plan = ilqr(&simulator, &state, &problem, Guess::Zero, &tight(), |p| {
        told.push(*p);
        ControlFlow::Break(())
    })
    .unwrap();
    assert_eq!(
        (plan.stop, plan.iterations, told.len()),
        (IlqrStop::Asked, 1, 1)
    );
    assert_eq!(told[0].cost, plan.cost());
    assert_eq!(plan.costs.len(), 2);
    assert!(plan.costs[1] < plan.costs[0] && told[0].part > 0.0 && told[0].expected > 0.0);
    let on = |guess: Guess| {
        ilqr(&simulator, &state, &problem, guess, &tight(), |_| {
            ControlFlow::Continue(())
        })
        .unwrap()
    };
    let whole = on(Guess::Zero);
    let resumed = on(Guess::Plan {
        plan: &plan.tracking(),
        shift: 0,
    });
    assert!(resumed.costs[0] <= plan.cost() * (1.0 + 1e-12));
    assert!((resumed.cost() / whole.cost() - 1.0).abs() < 1e-12);
    let again = on(Guess::Controls(&whole.controls));
    assert!(again.iterations <= 1, "{}", again.iterations);
    assert!(whole.times.total > 0.0 && whole.rate() > 0.0);
}
