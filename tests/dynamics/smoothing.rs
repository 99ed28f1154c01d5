//! Smoothed gradients, continuation, and the recipe for grasps.

use crate::support::{self, says};
use hydrograd::adjoint::sample::numbers;
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{
    Finger, GraspSettings, GraspStage, GraspTask, OptimizeSettings, Smoothing, continuation, grasp,
    minimise, smoothed,
};
use hydrograd::scene::{Body, Contact, Fluid, Joint, Plane, Scene, Shape};
use hydrograd::simulate::Knots;
use hydrograd::{Controls, Error, Fidelity, Settings, Simulator};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

type Evaluated = hydrograd::Result<(f64, Vec<f64>)>;

/// x₀² + 3 x₁ + x₀ x₁.
fn smooth(x: &[f64]) -> Evaluated {
    let cost = x[0] * x[0] + 3.0 * x[1] + x[0] * x[1];
    Ok((cost, vec![2.0 * x[0] + x[1], 3.0 + x[0]]))
}

/// A step at 0 that its gradient doesn't see: 1 below, 0 above.
fn step(x: &[f64]) -> Evaluated {
    Ok((if x[0] < 0.0 { 1.0 } else { 0.0 }, vec![0.0]))
}

#[test]
fn smooth_functions_keep_their_gradient() {
    let at = [0.4, -0.2];
    let exact = smooth(&at).unwrap().1;
    let settings = Smoothing {
        directions: 400,
        ..Smoothing::default()
    };
    let found = smoothed(smooth, &at, &settings).unwrap();
    // Gradients that are linear come out of opposite pairs exactly; slopes of values by chance.
    for (k, exact) in exact.iter().enumerate() {
        assert!((found.first.gradient[k] - exact).abs() < 1e-12);
        assert!(found.first.variance[k] < 1e-24);
        let deviation = found.zeroth.variance[k].sqrt();
        let miss = (found.zeroth.gradient[k] - exact).abs();
        assert!(
            miss < 4.0 * deviation && deviation < 0.3,
            "{miss}, {deviation}"
        );
    }
    assert_eq!(found.mixed(), found.first.gradient);
    // Its mean lies σ² above it, by the curvature along x₀ (2/2).
    let rise = found.cost - smooth(&at).unwrap().0;
    assert!((rise - 0.05_f64.powi(2)).abs() < 1e-3, "{rise}");
}

#[test]
fn jumps_are_seen_by_values_alone() {
    let settings = Smoothing {
        spread: 0.5,
        directions: 4000,
        seed: 3,
    };
    for x in [0.0_f64, 0.3, -0.6] {
        let found = smoothed(step, &[x], &settings).unwrap();
        // The slope of a step averaged over a normal distribution is the distribution's density.
        let density =
            (-0.5 * (x / 0.5).powi(2)).exp() / (0.5 * (2.0 * std::f64::consts::PI).sqrt());
        let (slope, deviation) = (found.zeroth.gradient[0], found.zeroth.variance[0].sqrt());
        println!(
            "at {x}: {slope:.4} for {:.4}, deviation {deviation:.4}",
            -density
        );
        assert!((slope + density).abs() < 4.0 * deviation && deviation < 0.02);
        assert_eq!(found.first.gradient, [0.0]);
        assert_eq!(found.mixed(), found.zeroth.gradient);
    }
}

#[test]
fn samples_are_the_same_everywhere_and_on_any_number_of_threads() {
    let settings = Smoothing::default();
    let seen = Mutex::new(Vec::new());
    let watched = |x: &[f64]| {
        seen.lock().unwrap().push(x[0]);
        smooth(x)
    };
    let first = smoothed(watched, &[0.0, 0.0], &settings).unwrap();
    let mut at_zero = std::mem::take(&mut *seen.lock().unwrap());
    smoothed(watched, &[0.25, 0.0], &settings).unwrap();
    let mut moved: Vec<f64> = seen.lock().unwrap().iter().map(|x| x - 0.25).collect();
    at_zero.sort_by(f64::total_cmp);
    moved.sort_by(f64::total_cmp);
    assert_eq!(at_zero.len(), 32);
    assert!(
        at_zero
            .iter()
            .zip(&moved)
            .all(|(a, b)| (a - b).abs() < 1e-15)
    );
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = pool.install(|| smoothed(smooth, &[0.0, 0.0], &settings).unwrap());
    assert_eq!(first, alone);
}

#[test]
fn failed_samples_are_left_out_and_counted() {
    let settings = Smoothing::default();
    let half = |x: &[f64]| match x[0] > 0.06 {
        true => Err(Error::input("x", x[0], "must be under 0.06")),
        false => smooth(x),
    };
    let found = smoothed(half, &[0.0, 0.0], &settings).unwrap();
    assert!(
        found.failures > 0 && found.failures < 16,
        "{}",
        found.failures
    );
    assert!((found.first.gradient[1] - 3.0).abs() < 1e-12);
    let never = |x: &[f64]| -> Evaluated { Err(Error::input("x", x[0], "must not be")) };
    says(
        smoothed(never, &[0.0], &settings).unwrap_err(),
        &["must not be"],
    );
    let nan = |_: &[f64]| Ok((f64::NAN, vec![0.0]));
    says(smoothed(nan, &[0.0], &settings).unwrap_err(), &["finite"]);
    for (wrong, words) in [
        (
            Smoothing {
                spread: 0.0,
                ..settings
            },
            ["spread", "positive"],
        ),
        (
            Smoothing {
                spread: f64::NAN,
                ..settings
            },
            ["spread", "positive"],
        ),
        (
            Smoothing {
                directions: 0,
                ..settings
            },
            ["directions", "at least 1"],
        ),
    ] {
        says(smoothed(smooth, &[0.0, 0.0], &wrong).unwrap_err(), &words);
    }
}

/// Two wells, the deeper one at x = 2; softened by ten there is but one.
#[test]
fn continuation_finds_the_deeper_well() {
    let well = |x: f64, depth: f64, at: f64, width: f64| {
        let e = depth * (-0.5 * ((x - at) / width).powi(2)).exp();
        (-e, e * (x - at) / (width * width))
    };
    let function = |softness: f64, x: &[f64]| {
        let shallow = well(x[0], 0.5, -2.0, 0.5 * softness.sqrt());
        let deep = well(x[0], 1.5, 2.0, 1.0 * softness.sqrt());
        Ok((2.0 + shallow.0 + deep.0, vec![shallow.1 + deep.1]))
    };
    let settings = OptimizeSettings::default();
    let end =
        |stages: &[f64]| continuation(function, stages, &[-2.2], &settings, |_, _| {}).unwrap();
    let (direct, softened) = (end(&[1.0]), end(&[10.0, 3.0, 1.0]));
    assert!((direct.x[0] + 2.0).abs() < 0.1, "{:?}", direct.x);
    assert!((softened.x[0] - 2.0).abs() < 0.01, "{:?}", softened.x);
    assert!(softened.evaluations > direct.evaluations);
    says(
        continuation(function, &[], &[0.0], &settings, |_, _| {}).unwrap_err(),
        &["stages", "at least 1"],
    );
}

/// Two fingers on rails and a ball between them that drifts away, dry.
fn pinch() -> (Simulator, GraspTask) {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.01;
    scene.steps = 100;
    let finger = |name: &str, x: f64| {
        Body::new(Shape::cuboid([0.1, 0.4, 0.4]))
            .named(name)
            .mass(2.0)
            .inertia([0.1, 0.1, 0.1])
            .at([x, 0.0, 0.0])
            .joint(Joint::Prismatic {
                axis: [1.0, 0.0, 0.0],
            })
            .actuated()
    };
    scene.add(finger("left", -0.4));
    scene.add(finger("right", 0.4));
    let ball = Body::new(Shape::sphere(0.1))
        .named("ball")
        .mass(0.5)
        .inertia([2e-3; 3]);
    scene.add(
        ball.at([0.02, 0.01, 0.0])
            .joint(Joint::Planar { plane: Plane::Xy }),
    );
    scene.initial.v = vec![0.0, 0.0, 0.0, 0.02, 0.1];
    scene.contact = Some(Contact {
        gap: Some(2e-3),
        ..Contact::default()
    });
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let finger = |body: &str, x: f64| Finger {
        body: body.into(),
        pad: [x, 0.0, 0.0],
    };
    let task = GraspTask {
        object: "ball".into(),
        fingers: vec![finger("left", 0.05), finger("right", -0.05)],
        closing: vec![1.0, -1.0],
        limits: vec![20.0; 2],
        hold: 0.2,
    };
    (Simulator::new(&scene, settings).unwrap(), task)
}

#[test]
fn costs_of_a_grasp_have_their_gradient() {
    let (simulator, task) = pinch();
    let knots = Knots::new(&simulator, 100, 7, &task.limits).unwrap();
    // They move, and don't touch.
    let x: Vec<f64> = numbers(5, knots.len(), 0.02);
    for (name, cost) in [
        (
            "approach",
            task.approach_cost(&simulator, [0.2, 0.5]).unwrap(),
        ),
        ("hold", task.hold_cost(&simulator).unwrap()),
    ] {
        let run = |x: &[f64]| {
            simulator
                .rollout(&knots.controls(&simulator, x).unwrap())
                .unwrap()
        };
        let base = run(&x);
        let gradient = base.gradient(&cost).unwrap();
        let gradient = knots.controls_vjp(&x, &gradient.controls).unwrap();
        let along = numbers(7, x.len(), 1.0);
        let slope: f64 = gradient.iter().zip(&along).map(|(g, e)| g * e).sum();
        let value = |h: f64| {
            let moved: Vec<f64> = x.iter().zip(&along).map(|(x, e)| x + h * e).collect();
            run(&moved).value(&cost).unwrap()
        };
        let h = 1e-4;
        let coarse = (value(h) - value(-h)) / (2.0 * h);
        let fine = (value(0.5 * h) - value(-0.5 * h)) / h;
        let difference = (4.0 * fine - coarse) / 3.0;
        println!("{name}: {slope:e} for {difference:e}");
        assert!(
            (slope - difference).abs() <= 1e-7 * difference.abs(),
            "{name}"
        );
    }
}

fn on(_: GraspStage, _: bool) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// What asks to be stopped ends each of them, in the midst of pushes as of a descent.
#[test]
fn who_stops_them_is_heard() {
    let (simulator, task) = pinch();
    let steps = AtomicUsize::new(0);
    let soon = |_: GraspStage, _: bool| match steps.fetch_add(1, Ordering::Relaxed) < 500 {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    };
    let settings = GraspSettings::default();
    let error = grasp(&simulator, &task, &settings, soon).unwrap_err();
    assert!(matches!(error, Error::Stopped { .. }), "{error}");
    let made = steps.into_inner();
    assert!(made < 1000, "{made} steps");
    let in_descent = |stage: GraspStage, _: bool| match stage {
        GraspStage::Push => ControlFlow::Continue(()),
        _ => ControlFlow::Break(()),
    };
    // So little is good enough that it is polished.
    let settings = GraspSettings {
        target: 0.0,
        ..settings
    };
    let error = grasp(&simulator, &task, &settings, in_descent).unwrap_err();
    assert!(matches!(error, Error::Stopped { .. }), "{error}");

    let calls = Cell::new(0);
    let stopping = |x: &[f64]| {
        calls.set(calls.get() + 1);
        match calls.get() {
            3 => Err(Error::Stopped {
                what: "a test".into(),
            }),
            _ => Ok((x[0].powi(4) + 1.0, vec![4.0 * x[0].powi(3)])),
        }
    };
    let settings = OptimizeSettings::default();
    let error = minimise(stopping, &[5.0], &settings, |_| {}).unwrap_err();
    assert!(matches!(error, Error::Stopped { .. }), "{error}");
    assert_eq!(calls.replace(0), 3);
    let in_first = |_: f64, x: &[f64]| stopping(x);
    let error = continuation(in_first, &[2.0, 1.0], &[5.0], &settings, |_, _| {}).unwrap_err();
    assert!(matches!(error, Error::Stopped { .. }), "{error}");
    assert_eq!(calls.get(), 3);
    let half = |x: &[f64]| match x[0] > 0.0 {
        true => Err(Error::Stopped {
            what: "a test".into(),
        }),
        false => Ok((x[0], vec![1.0])),
    };
    let error = smoothed(half, &[0.0], &Smoothing::default()).unwrap_err();
    assert!(matches!(error, Error::Stopped { .. }), "{error}");
}

#[test]
fn a_drifting_ball_is_caught() {
    let (simulator, task) = pinch();
    let settings = GraspSettings {
        pushes: 24,
        ..GraspSettings::default()
    };
    let found = grasp(&simulator, &task, &settings, on).unwrap();
    println!(
        "{:?}, cost {}, {} of 24 pushes",
        found.stage, found.cost, found.pushes_caught
    );
    let rollout = simulator.rollout(&found.controls).unwrap();
    let since = task.held_since(&rollout).unwrap();
    assert!(found.caught && since == found.held_since);
    assert!(since.is_some_and(|t| t <= 0.8), "{since:?}");
    // Without forces it isn't.
    let idle = Controls::zeros(&simulator, 100);
    let idle = simulator.rollout(&idle).unwrap();
    assert_eq!(task.held_since(&idle).unwrap(), None);
    let again = grasp(&simulator, &task, &settings, on).unwrap();
    assert_eq!(found.controls, again.controls);
}

#[test]
fn tasks_that_do_not_fit_are_refused() {
    let (simulator, task) = pinch();
    let settings = GraspSettings::default();
    let fails = |change: &dyn Fn(&mut GraspTask), words: &[&str]| {
        let mut wrong = task.clone();
        change(&mut wrong);
        says(grasp(&simulator, &wrong, &settings, on).unwrap_err(), words);
    };
    fails(
        &|t| t.object = "bell".into(),
        &["object", "\"bell\"", "ball"],
    );
    fails(
        &|t| t.fingers[1].body = "thumb".into(),
        &["finger", "\"thumb\"", "left"],
    );
    fails(&|t| t.fingers.truncate(1), &["fingers", "at least 2"]);
    fails(
        &|t| t.fingers[0].body = "ball".into(),
        &["finger", "\"ball\"", "another body than the object"],
    );
    fails(
        &|t| t.fingers[1].body = "left".into(),
        &["finger", "\"left\"", "another finger has"],
    );
    // From the middle of a finger its corners are 0.287 m away.
    fails(
        &|t| t.fingers[0].pad = [0.3, 0.0, 0.0],
        &["pad", "\"left\"", "3.000e-1 m", "within 2.872e-1 m"],
    );
    fails(
        &|t| t.fingers[0].pad[1] = f64::NAN,
        &["pad", "left", "finite"],
    );
    fails(&|t| t.closing = vec![1.0], &["closing", "2 numbers"]);
    fails(&|t| t.closing = vec![0.0; 2], &["closing", "zero for all"]);
    fails(&|t| t.closing[0] = 2.0, &["closing", "from -1 to 1"]);
    fails(&|t| t.limits[0] = -1.0, &["limits", "positive"]);
    fails(&|t| t.hold = 3.0, &["hold", "less than the 1 s"]);
    let wrong = GraspSettings {
        softness: vec![2.0],
        ..settings
    };
    says(
        grasp(&simulator, &task, &wrong, on).unwrap_err(),
        &["softness", "end in 1"],
    );
    let cost = task.hold_cost(&simulator).unwrap();
    let mut other = Scene::new(Fluid::none());
    other.add(Body::dry().mass(1.0).inertia([1.0; 3]));
    let other = support::simulator(&other, Fidelity::Isolated, Integrator::MomentumEuler);
    let rollout = other.rollout(&Controls::zeros(&other, 2)).unwrap();
    says(
        rollout.value(&cost).unwrap_err(),
        &["1 bodies and 0 controls", "made for"],
    );
    // Nothing of a run that ends before counts, nor of a span without times.
    let short = Controls::zeros(&simulator, 20);
    let short = simulator.rollout(&short).unwrap();
    for (span, words) in [
        ([0.5, 0.9], ["0.5 to 0.9 s", "from 0 to 0.2 s"]),
        ([0.15, 0.1], ["0.15 to 0.1 s", "hold states"]),
        ([f64::NAN, 0.1], ["NaN to 0.1 s", "hold states"]),
    ] {
        let cost = task.approach_cost(&simulator, span).unwrap();
        says(short.value(&cost).unwrap_err(), &words);
        says(short.gradient(&cost).unwrap_err(), &words);
    }
    let mut softer = simulator.clone();
    says(
        softer.soften_contact(0.0).unwrap_err(),
        &["softening", "positive"],
    );
}
