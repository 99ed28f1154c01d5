//! Descent: known minima, functions that fail in part of the plane, every way to end, settings that can't be.

use hydrograd::optimize::{self, OptimizeProgress, OptimizeSettings, Optimum, Stop, minimise};
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::{Controls, Error, Fidelity, Simulator, objective};

type Evaluated = hydrograd::Result<(f64, Vec<f64>)>;

fn descend(
    function: impl FnMut(&[f64]) -> Evaluated,
    start: &[f64],
    settings: &OptimizeSettings,
) -> hydrograd::Result<Optimum> {
    minimise(function, start, settings, |_| {})
}

/// Least value 0 at (1, 1), at the end of a bent valley.
fn rosenbrock(x: &[f64]) -> Evaluated {
    let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
    let gradient = vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b];
    Ok((a * a + 100.0 * b * b, gradient))
}

/// ½ Σ k_i (x_i − i)² with k from 1 to 1000.
fn quadratic(x: &[f64]) -> Evaluated {
    let parts = x.iter().enumerate().map(|(i, x)| {
        let stiffness = 1000_f64.powf(i as f64 / 5.0);
        (stiffness, x - i as f64)
    });
    let cost = parts.clone().map(|(k, d)| 0.5 * k * d * d).sum();
    Ok((cost, parts.map(|(k, d)| k * d).collect()))
}

/// Least value 1 at (3, 0), but nothing beyond x = 3.2.
fn half_plane(x: &[f64]) -> Evaluated {
    if x[0] > 3.2 {
        return Err(Error::input("x", x[0], "must be under 3.2"));
    }
    let (a, b) = (x[0] - 3.0, x[1]);
    Ok((1.0 + a * a + 4.0 * b * b, vec![2.0 * a, 8.0 * b]))
}

/// From 1 down to 0 over a cliff at x = 3, and up again slowly behind it.
fn cliff(x: &[f64]) -> Evaluated {
    let fall = 1.0 / (1.0 + (40.0 * (x[0] - 3.0)).exp());
    let cost = fall + 0.01 * (x[0] - 5.0).powi(2);
    let slope = -40.0 * fall * (1.0 - fall) + 0.02 * (x[0] - 5.0);
    Ok((cost, vec![slope]))
}

#[test]
fn minima_are_found() {
    let tight = OptimizeSettings {
        gradient_tolerance: 1e-14,
        cost_tolerance: 0.0,
        ..OptimizeSettings::default()
    };
    let found = descend(rosenbrock, &[-1.2, 1.0], &tight).unwrap();
    println!("Rosenbrock: {found:?}");
    assert!(found.x.iter().all(|x| (x - 1.0).abs() < 1e-8));
    assert!(found.evaluations < 100);

    let found = descend(quadratic, &[0.5; 6], &tight).unwrap();
    println!("quadratic: {found:?}");
    let errors = found
        .x
        .iter()
        .enumerate()
        .map(|(i, x)| (x - i as f64).abs());
    assert!(errors.fold(0.0, f64::max) < 1e-8);
    assert_eq!(found.failures, 0);
}

#[test]
fn the_best_point_is_what_was_found() {
    let mut seen = Vec::new();
    let function = |x: &[f64]| {
        let out = rosenbrock(x)?;
        seen.push((x.to_vec(), out.0));
        Ok(out)
    };
    let few = OptimizeSettings {
        evaluations: 17,
        ..OptimizeSettings::default()
    };
    let found = descend(function, &[-1.2, 1.0], &few).unwrap();
    let best = seen.iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert_eq!((&found.x, found.cost), (&best.0, best.1));
    assert_eq!((found.evaluations, seen.len()), (17, 17));
    assert_eq!(found.stop, Stop::Budget);
}

#[test]
fn every_iteration_is_heard_of() {
    let mut reports: Vec<OptimizeProgress> = Vec::new();
    let settings = OptimizeSettings::default();
    let found = minimise(rosenbrock, &[-1.2, 1.0], &settings, |p| reports.push(*p)).unwrap();
    let numbers: Vec<usize> = reports.iter().map(|p| p.iteration).collect();
    assert_eq!(numbers, (1..=found.iterations).collect::<Vec<_>>());
    assert!(
        reports
            .windows(2)
            .all(|w| w[1].cost <= w[0].cost && w[1].evaluations >= w[0].evaluations)
    );
    let last = reports[reports.len() - 1];
    assert_eq!(
        (last.cost, last.evaluations),
        (found.cost, found.evaluations)
    );
}

/// A first step of 40 lands where there is no value.
#[test]
fn failures_turn_the_search_back() {
    let far = OptimizeSettings {
        first_step: Some(40.0),
        ..OptimizeSettings::default()
    };
    let found = descend(half_plane, &[-5.0, 2.0], &far).unwrap();
    println!("half plane: {found:?}");
    assert!(found.failures > 0);
    assert!((found.x[0] - 3.0).hypot(found.x[1]) < 1e-4);

    // The least value itself lies where there is none: it ends at the border.
    let beyond = |x: &[f64]| {
        let (_, gradient) = half_plane(x)?;
        Ok((-x[0] + x[1] * x[1], vec![-1.0, 0.25 * gradient[1]]))
    };
    let found = descend(beyond, &[-5.0, 2.0], &far).unwrap();
    println!("border: {found:?}");
    assert!(found.failures > 0 && found.x[0] <= 3.2);
    assert!(found.x[0] > 3.0, "{:?}", found.x);
}

/// What isn't a number, or of another length than the point, is a failure like any other.
#[test]
fn what_is_no_number_turns_the_search_back() {
    let far = OptimizeSettings {
        first_step: Some(40.0),
        ..OptimizeSettings::default()
    };
    for bad in [
        (f64::NAN, vec![0.0; 2]),
        (0.0, vec![f64::INFINITY, 0.0]),
        (0.0, vec![0.0; 3]),
    ] {
        let function = |x: &[f64]| half_plane(x).or(Ok(bad.clone()));
        let found = descend(function, &[-5.0, 2.0], &far).unwrap();
        assert!(found.failures > 0);
        assert!((found.x[0] - 3.0).hypot(found.x[1]) < 1e-4);
    }
}

/// A search of two points: the start, with a slope of 0.1, and one on the cliff with a slope of 10.
#[test]
fn gradients_are_clipped() {
    let found = |clip: Option<f64>, evaluations: usize| {
        let settings = OptimizeSettings {
            clip,
            first_step: Some(3.0),
            evaluations,
            ..OptimizeSettings::default()
        };
        descend(cliff, &[0.0], &settings).unwrap()
    };
    let (free, clipped) = (found(None, 2), found(Some(2.0), 2));
    assert!((free.x[0] - 3.0).abs() < 1e-9 && free.x == clipped.x);
    assert!((free.gradient - 10.04).abs() < 1e-6, "{}", free.gradient);
    assert!((clipped.gradient - 0.2).abs() < 1e-9);
    assert!((found(Some(0.5), 1).gradient - 0.05).abs() < 1e-9);
    // Shorter gradients lead to the same place.
    assert!((found(Some(2.0), 100).x[0] - 5.0).abs() < 1e-3);
}

#[test]
fn every_end_is_reached() {
    let from = [-1.2, 1.0];
    let stop = |settings: OptimizeSettings| descend(rosenbrock, &from, &settings).unwrap();

    let target = stop(OptimizeSettings {
        target: Some(1e-3),
        ..OptimizeSettings::default()
    });
    assert_eq!(target.stop, Stop::Target);
    assert!(target.cost <= 1e-3 && target.iterations > 0);

    let gradient = stop(OptimizeSettings {
        gradient_tolerance: 1e-3,
        cost_tolerance: 0.0,
        ..OptimizeSettings::default()
    });
    assert_eq!(gradient.stop, Stop::Gradient);
    assert!(gradient.gradient <= 1e-3 * 232.867_687_75);

    let cost = stop(OptimizeSettings {
        gradient_tolerance: 0.0,
        cost_tolerance: 0.5,
        ..OptimizeSettings::default()
    });
    assert_eq!(cost.stop, Stop::Cost);

    for settings in [
        OptimizeSettings {
            iterations: 3,
            ..OptimizeSettings::default()
        },
        OptimizeSettings {
            evaluations: 5,
            ..OptimizeSettings::default()
        },
    ] {
        let found = stop(settings);
        assert_eq!(found.stop, Stop::Budget);
        assert!(found.iterations <= settings.iterations);
        assert!(found.evaluations <= settings.evaluations);
    }

    // Where it starts is already right, or level.
    let there = OptimizeSettings {
        target: Some(0.0),
        ..OptimizeSettings::default()
    };
    let found = descend(rosenbrock, &[1.0, 1.0], &there).unwrap();
    assert_eq!((found.stop, found.evaluations), (Stop::Target, 1));
    let found = descend(rosenbrock, &[1.0, 1.0], &OptimizeSettings::default()).unwrap();
    assert_eq!((found.stop, found.evaluations), (Stop::Gradient, 1));

    // No trial is lower, because the gradient is a lie.
    let lie = |x: &[f64]| Ok((x[0].abs(), vec![-1.0]));
    let found = descend(lie, &[0.0], &OptimizeSettings::default()).unwrap();
    assert_eq!((found.stop, found.x), (Stop::Cost, vec![0.0]));
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = OptimizeSettings::default;
    let zero = |name| (name, 0.0);
    let mut wrong: Vec<(&str, f64, OptimizeSettings)> = Vec::new();
    for (name, value) in [zero("first_step"), ("first_step", f64::NAN)] {
        wrong.push((
            name,
            value,
            OptimizeSettings {
                first_step: Some(value),
                ..good()
            },
        ));
    }
    for (name, value) in [zero("clip"), ("clip", -1.0), ("clip", f64::INFINITY)] {
        wrong.push((
            name,
            value,
            OptimizeSettings {
                clip: Some(value),
                ..good()
            },
        ));
    }
    for value in [-1e-9, f64::NAN] {
        wrong.push((
            "gradient_tolerance",
            value,
            OptimizeSettings {
                gradient_tolerance: value,
                ..good()
            },
        ));
        wrong.push((
            "cost_tolerance",
            value,
            OptimizeSettings {
                cost_tolerance: value,
                ..good()
            },
        ));
    }
    wrong.push((
        "target",
        f64::NAN,
        OptimizeSettings {
            target: Some(f64::NAN),
            ..good()
        },
    ));
    wrong.push((
        "iterations",
        0.0,
        OptimizeSettings {
            iterations: 0,
            ..good()
        },
    ));
    wrong.push((
        "evaluations",
        0.0,
        OptimizeSettings {
            evaluations: 0,
            ..good()
        },
    ));
    wrong.push((
        "memory",
        0.0,
        OptimizeSettings {
            memory: 0,
            ..good()
        },
    ));
    for (name, value, settings) in wrong {
        let called = |_: &[f64]| -> Evaluated { panic!("settings are checked first") };
        let error = descend(called, &[0.0], &settings).unwrap_err().to_string();
        assert!(
            error.contains(&format!("optimize settings: {name}")),
            "{error}"
        );
        assert!(error.contains(&value.to_string()), "{error}");
    }
}

#[test]
fn a_start_that_fails_is_an_error() {
    let settings = OptimizeSettings::default();
    let error = descend(half_plane, &[4.0, 0.0], &settings).unwrap_err();
    assert!(error.to_string().contains("must be under 3.2"), "{error}");
    let error = descend(|_| Ok((f64::NAN, vec![0.0])), &[0.0], &settings).unwrap_err();
    assert!(error.to_string().contains("must be finite"), "{error}");
    let error = descend(|_| Ok((0.0, vec![0.0; 3])), &[0.0; 2], &settings).unwrap_err();
    assert!(error.to_string().contains("must be 2 numbers"), "{error}");
    let error = descend(|_| Ok((0.0, Vec::new())), &[], &settings).unwrap_err();
    assert!(
        error.to_string().contains("start of the descent"),
        "{error}"
    );
}

#[test]
fn the_same_again_gives_the_same() {
    let far = OptimizeSettings {
        first_step: Some(40.0),
        clip: Some(3.0),
        ..OptimizeSettings::default()
    };
    let once = || descend(half_plane, &[-5.0, 2.0], &far).unwrap();
    assert_eq!(once(), once());
}

/// A driven ball beside a free coin, both weightless: the water alone carries the coin.
fn ball_and_coin() -> (Simulator, Optimum<Controls>, f64) {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = Body::new(Shape::sphere(0.05)).density(998.0);
    scene.add(ball.at([-0.12, 0.0, 0.0]).actuated());
    let coin = Body::new(Shape::ellipsoid([0.04, 0.04, 0.01])).density(998.0);
    let coin = scene.add(coin);
    let settings = hydrograd::Settings::default().fidelity(Fidelity::Reduced);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let goal = objective::final_position(coin, [0.003, 0.0, 0.0]) + objective::effort(1e-9);
    let start = Controls::zeros(&simulator, 40);
    let before = simulator.rollout(&start).unwrap().value(&goal).unwrap();
    let best = optimize::lbfgs(&simulator, start, &goal).unwrap();
    let again = simulator.rollout(&best.x).unwrap();
    assert_eq!(again.value(&goal).unwrap(), best.cost);
    (simulator, best, before)
}

#[test]
fn controls_of_a_small_scene_lower_its_objective_tenfold() {
    let (_, best, before) = ball_and_coin();
    println!(
        "{before:.3e} to {:.3e} m² in {} rollouts, {} iterations, {:?}",
        best.cost, best.evaluations, best.iterations, best.stop
    );
    assert!(best.cost < 0.1 * before);
    assert_eq!(ball_and_coin().1, best);
}

#[test]
fn a_scene_without_controls_is_an_error() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = scene.add(Body::new(Shape::sphere(0.05)).density(998.0));
    let settings = hydrograd::Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let goal = objective::final_position(ball, [0.1, 0.0, 0.0]);
    let error = optimize::lbfgs(&simulator, Controls::zeros(&simulator, 10), &goal).unwrap_err();
    assert!(
        error.to_string().contains("start of the descent"),
        "{error}"
    );
}
