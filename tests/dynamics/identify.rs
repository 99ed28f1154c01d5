//! Parameters recovered from recordings that the simulator makes itself, with noise and known truth.

use crate::support::says;
use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{
    Experiment, Identified, IdentifySettings, IdentifyStop, Loss, Recorded, Unknown, identify,
};
use hydrograd::scene::{Body, Damping, Fluid, Motion, Scene, Shape};
use hydrograd::simulate::Objective as _;
use hydrograd::{Controls, Fidelity, Joint, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

const STEPS: usize = 150;
/// Noise of an attitude, rad.
const NOISE: f64 = 2e-3;
/// Moments per rate, roll, pitch and yaw: the truth.
const DAMPING: [f64; 3] = [0.05, 0.08, 0.06];

/// Zero of the arm's joint, rad: the coordinate of a locked one before it.
const ZERO: f64 = 0.06;

/// A neutrally buoyant vehicle that an arm, driven through a recording, tips.
fn vehicle(amplitude: f64) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.time_step = 0.02;
    let hull = Shape::ellipsoid([0.2, 0.15, 0.12]).faces(80);
    scene.add(
        Body::new(hull)
            .named("hull")
            .density(998.0)
            .center_of_mass([0.0, 0.0, -0.01]),
    );
    let times: Vec<f64> = (0..8).map(|i| 0.5 * f64::from(i)).collect();
    let angles = times.iter().map(|t| amplitude * (1.3 * t).sin()).collect();
    let axis = [0.3, 1.0, 0.0];
    let mount = Body::dry().named("mount").child_of("hull").mass(0.0);
    let mut mount = mount.at([0.35, 0.05, 0.0]).joint(Joint::Revolute { axis });
    mount.locked = true;
    mount.start = vec![ZERO];
    scene.add(mount);
    scene.add(
        Body::new(Shape::ellipsoid([0.12, 0.02, 0.02]).faces(80))
            .named("arm")
            .child_of("mount")
            .density(1400.0)
            .joint(Joint::Revolute { axis })
            .driven([Motion::through(times, angles).unwrap()]),
    );
    let [roll, pitch, yaw] = DAMPING;
    let damping = Damping::new("hull").named("water");
    scene.add_force(damping.linear([0.5, 0.5, 0.5, roll, pitch, yaw]).into());
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(&scene, settings).unwrap()
}

/// What is seen of the attitude with noise of its own, a run each.
fn experiments(noise: f64, seed: u64) -> Vec<Experiment> {
    let mut random = Samples::new(seed);
    [0.4, -0.7]
        .map(|amplitude| {
            let simulator = vehicle(amplitude);
            let controls = Controls::zeros(&simulator, STEPS);
            let rollout = simulator.rollout(&controls).unwrap();
            let attitudes = rollout.observe("attitudes").unwrap();
            let mut out = Experiment::new(format!("arm {amplitude}"), simulator, controls);
            for entry in [0, 1] {
                let states: Vec<usize> = (1..=STEPS).collect();
                let values = states
                    .iter()
                    .map(|n| attitudes[(entry, *n)] + noise * random.normal());
                out = out.saw(Recorded {
                    observable: "attitudes".into(),
                    entry,
                    values: values.collect(),
                    states,
                    deviation: NOISE,
                });
            }
            out
        })
        .into()
}

const NAMES: [&str; 4] = [
    "hull.center_of_mass.z",
    "hull.center_of_mass.y",
    "water.linear.wx",
    "water.linear.wy",
];

fn truth() -> [f64; 4] {
    [-0.01, 0.0, DAMPING[0], DAMPING[1]]
}

fn unknowns() -> Vec<Unknown> {
    vec![
        Unknown::new(NAMES[0]).start(-0.02).within(-0.05, 0.0),
        Unknown::new(NAMES[1]).start(0.004).prior(0.0, 0.01),
        Unknown::new(NAMES[2]).positive().start(0.2),
        Unknown::new(NAMES[3]).positive().start(0.02),
    ]
}

fn found(experiments: &[Experiment], settings: &IdentifySettings) -> Identified {
    identify(experiments, &unknowns(), settings, |_| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

/// Without noise the truth to 1e-6; with it within four standard errors, whose size a misfit of 1 confirms.
#[test]
fn a_vehicle_is_recovered() {
    let exact = found(&experiments(0.0, 1), &IdentifySettings::default());
    for (u, truth) in exact.unknowns.iter().zip(truth()) {
        let off = (u.value - truth).abs();
        assert!(
            off < 1e-6 * truth.abs().max(1e-2),
            "{}: {}",
            u.name,
            u.value
        );
    }
    let noisy = found(&experiments(NOISE, 2), &IdentifySettings::default());
    for (u, truth) in noisy.unknowns.iter().zip(truth()) {
        let off = (u.value - truth).abs() / u.standard_error;
        assert!(off < 4.0, "{}: {} ± {}", u.name, u.value, u.standard_error);
        assert!(!u.at_bound);
    }
    assert!(
        (0.8..1.2).contains(&noisy.chi_squared),
        "{}",
        noisy.chi_squared
    );
    assert!(noisy.inflation < 1.2);
    assert!(noisy.simulations <= 2 * 20 + 2 * 4);
    assert_eq!(noisy.series.len(), 4);
    assert!(
        noisy
            .series
            .iter()
            .all(|s| (s.rms / NOISE - 1.0).abs() < 0.2)
    );
    // About the best point the misfit is the parabola that its curvature says, to what is known of a logarithm's.
    for p in &noisy.weak[0].profile {
        let rise = p.rise.expect("it can be simulated");
        assert!((rise / p.expected - 1.0).abs() < 0.3, "{p:?}");
    }
    let named = noisy.value("water.linear.wx").unwrap();
    let parameters = noisy.parameters(&vehicle(0.1)).unwrap();
    assert_eq!(parameters.get("water.linear.wx").unwrap(), named);
}

/// The zero of a joint, a coordinate of the start that all runs share, to 1e-6; the parameter beside it as before.
#[test]
fn a_joints_zero_is_recovered() {
    let zero = Unknown::new("zero")
        .sets_start("mount.angle", 1.0)
        .start(-0.1);
    let both = [zero, Unknown::new(NAMES[3]).positive().start(0.3)];
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let made = identify(&experiments(0.0, 7), &both, &settings, go).unwrap();
    assert!(
        (made.unknowns[0].value - ZERO).abs() < 1e-6,
        "{:?}",
        made.unknowns[0]
    );
    assert!((made.unknowns[1].value - DAMPING[1]).abs() < 1e-6);
    assert_eq!(made.unknowns[0].starts, [("mount.angle".to_string(), 1.0)]);
    let driven = [Unknown::new("arm").sets_start("arm.angle", 1.0)];
    let error = identify(&experiments(0.0, 7), &driven, &settings, go).unwrap_err();
    says(error, &["arm.angle", "driven by a motion"]);
}

/// Residuals of a function of observables, and a law of how a parameter depends on the run: recovered as the numbers themselves.
#[test]
fn functions_and_scales() {
    let unknown = Unknown::new("damping")
        .sets(NAMES[2], 1.0)
        .positive()
        .start(0.4);
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let made = [(0.4, 1.0), (-0.7, 3.0)].map(|(amplitude, scale)| {
        let mut truth = vehicle(amplitude);
        let mut parameters = truth.parameters().clone();
        parameters.set(NAMES[2], scale * DAMPING[0]).unwrap();
        truth.set_parameters(parameters).unwrap();
        let controls = Controls::zeros(&truth, STEPS);
        let attitudes = truth
            .rollout(&controls)
            .unwrap()
            .observe("attitudes")
            .unwrap();
        // The energy of roll over the run, and its largest value as a smooth mean.
        let of = |a: &DMatrix<f64>| {
            let roll = a.row(0).into_owned();
            let power: f64 = roll.iter().map(|x| x.powi(8)).sum();
            DVector::from_vec(vec![roll.norm(), power.powf(0.125)])
        };
        let seen = of(&attitudes);
        let experiment = Experiment::new("run", vehicle(amplitude), controls);
        let states = (0..=STEPS).collect();
        experiment
            .scaled(NAMES[2], scale)
            .saw_function(&["attitudes"], states, move |a| {
                Ok((of(&a[0]) - &seen) / NOISE)
            })
    });
    let found = identify(&made, &[unknown], &settings, go).unwrap();
    assert!(
        (found.unknowns[0].value / DAMPING[0] - 1.0).abs() < 1e-6,
        "{found:?}"
    );
}

/// Where nothing of what is recorded depends on an unknown, it stays where it was, its error is infinite or the prior's, and the direction says so.
#[test]
fn what_nothing_tells_is_said() {
    let yaw = "water.linear.wz";
    let experiments = &experiments(NOISE, 3)[..1];
    // Yaw is all but unseen in roll and pitch: without recordings of it only the prior knows it.
    let known = [Unknown::new(NAMES[0]), Unknown::new(yaw).prior(0.06, 0.03)];
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let made = identify(experiments, &known, &settings, go).unwrap();
    assert!(
        made.unknowns[1].of_prior.is_some_and(|part| part > 0.5),
        "{made:?}"
    );
    // A parameter that acts on nothing.
    let nothing = [
        Unknown::new(NAMES[0]),
        Unknown::new("contact.friction").start(0.3),
    ];
    let made = identify(experiments, &nothing, &settings, go).unwrap();
    assert!((made.unknowns[1].value - 0.3).abs() < 1e-9);
    assert!(made.unknowns[1].standard_error.is_infinite());
    assert!(made.unknowns[0].standard_error < 1e-3);
    assert!(made.weak[0].deviation.is_infinite() && made.weak[0].profile.is_empty());
}

/// What acts by rounding alone stays where it was, with an infinite error, and hinders no other: a coin that sinks flat, of which only the height is seen.
#[test]
fn rounding_tells_nothing() {
    let coin = |mass: f64, damping: f64| {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.gravity = [0.0, 0.0, -9.81];
        scene.time_step = 0.01;
        let shape = Shape::ellipsoid([0.03, 0.03, 0.005]).faces(80);
        scene.add(Body::new(shape).named("coin").mass(mass));
        let water = Damping::new("coin").named("water");
        scene.add_force(water.linear([1.0, 1.0, damping, 1e-3, 1e-3, 1e-3]).into());
        Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap()
    };
    let truth = coin(0.03, 0.4);
    let controls = Controls::zeros(&truth, 80);
    let rollout = truth.rollout(&controls).unwrap();
    let positions = rollout.observe("positions").unwrap();
    let mut random = Samples::new(4);
    let states: Vec<usize> = (1..=80).collect();
    let noisy = |k: &usize| positions[(2, *k)] + 1e-4 * random.normal();
    let values = states.iter().map(noisy).collect();
    let seen = Recorded {
        observable: "positions".into(),
        entry: 2,
        values,
        states,
        deviation: 1e-4,
    };
    let simulator = coin(0.03, 0.4);
    let experiment = Experiment::new("fall", simulator, controls).saw(seen);
    let known = || {
        vec![
            Unknown::new("coin.mass").positive().start(0.045),
            Unknown::new("water.linear.z").positive().start(0.2),
        ]
    };
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let alone = identify(std::slice::from_ref(&experiment), &known(), &settings, go).unwrap();
    for name in [
        "coin.inertia.xx",
        "coin.inertia.xy",
        "coin.center_of_mass.x",
    ] {
        let mut all = known();
        all.push(Unknown::new(name));
        let made = identify(std::slice::from_ref(&experiment), &all, &settings, go).unwrap();
        let [mass, damping, other] = &made.unknowns[..] else {
            panic!("{made:?}")
        };
        println!(
            "{name}: mass {:.4}, damping {:.3}, {} iterations, {:?}",
            mass.value, damping.value, made.iterations, made.stop
        );
        assert!(
            made.cost <= 1.001 * alone.cost,
            "{name}: {} for {}",
            made.cost,
            alone.cost
        );
        assert_eq!(other.value, other.start, "{name}");
        assert!(other.standard_error.is_infinite(), "{name}: {other:?}");
        assert!(
            mass.standard_error < 0.01 && damping.standard_error < 0.2,
            "{made:?}"
        );
    }
}

/// An initial velocity that isn't what was said, found with the rest; values far off that a loss forgives.
#[test]
fn starts_and_outliers() {
    let mut runs = experiments(NOISE, 4);
    let truth = vehicle(0.4);
    let mut off = truth.clone();
    let (q, v) = truth.start();
    let mut moved = v.clone();
    moved[3] += 0.1;
    off.set_start(q.clone(), moved).unwrap();
    let controls = Controls::zeros(&off, STEPS);
    let rollout = truth.rollout(&controls).unwrap();
    let attitudes = rollout.observe("attitudes").unwrap();
    let mut run = Experiment::new("pushed", off, controls).start_within(0.0, 0.2);
    for entry in [0, 1, 2] {
        let states: Vec<usize> = (1..=STEPS).collect();
        // Every fifteenth reading of the pitch is nonsense.
        let wrong = |n: usize| f64::from(u8::from(entry == 1 && n.is_multiple_of(15)));
        run = run.saw(Recorded {
            observable: "attitudes".into(),
            entry,
            values: states
                .iter()
                .map(|n| attitudes[(entry, *n)] + wrong(*n))
                .collect(),
            states,
            deviation: NOISE,
        });
    }
    runs.push(run);
    let settings = IdentifySettings {
        loss: Loss::Cauchy(3.0),
        ..IdentifySettings::default()
    };
    let robust = found(&runs, &settings);
    let v = DVector::from_vec(robust.starts[2].1.clone());
    let truth_v = truth.start().1;
    assert!((v.rows(3, 3) - truth_v.rows(3, 3)).norm() < 5e-3, "{v}");
    for (u, truth) in robust.unknowns.iter().zip(self::truth()) {
        let error = u.standard_error;
        assert!(
            (u.value - truth).abs() < 5.0 * error,
            "{} {} {error}",
            u.name,
            u.value
        );
    }
}

/// A bound that is in the way holds; the search can be ended, and says why it ended.
#[test]
fn bounds_and_ends() {
    let runs = experiments(0.0, 5);
    let held = [Unknown::new(NAMES[2]).start(0.2).within(0.1, 0.3)];
    let settings = IdentifySettings::default();
    let made = identify(&runs, &held, &settings, |_| ControlFlow::Continue(())).unwrap();
    assert!(made.unknowns[0].at_bound && made.unknowns[0].value == 0.1);
    assert_eq!(made.unknowns[0].standard_error, 0.0);
    let made = identify(&runs, &unknowns(), &settings, |p| match p.iteration {
        1 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    });
    let made = made.unwrap();
    assert_eq!((made.stop, made.iterations), (IdentifyStop::Asked, 1));
}

#[test]
fn bad_input_is_named() {
    let runs = experiments(0.0, 6);
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let refused = |runs: &[Experiment], unknowns: &[Unknown], said: &[&str]| {
        says(identify(runs, unknowns, &settings, go).unwrap_err(), said);
    };
    let good = [Unknown::new(NAMES[0])];
    refused(&[], &good, &["experiments", "none"]);
    refused(&runs, &[], &["unknowns", "none"]);
    refused(&runs, &[Unknown::new("hull.colour")], &["hull.colour"]);
    let twice = [
        Unknown::new(NAMES[0]),
        Unknown::new("z").sets(NAMES[0], 2.0),
    ];
    refused(&runs, &twice, &["another unknown"]);
    let below = [Unknown::new(NAMES[2]).positive().start(-1.0)];
    refused(&runs, &below, &["water.linear.wx", "positive"]);
    let outside = [Unknown::new(NAMES[0]).start(1.0).within(-1.0, 0.5)];
    refused(&runs, &outside, &["bounds"]);
    let sure = [Unknown::new(NAMES[0]).prior(0.0, 0.0)];
    refused(&runs, &sure, &["deviation"]);
    let simulator = vehicle(0.2);
    let controls = Controls::zeros(&simulator, STEPS);
    let bare = Experiment::new("bare", simulator, controls);
    refused(std::slice::from_ref(&bare), &good, &["bare", "saw"]);
    let seen = |observable: &str, entry, state, value, deviation| Recorded {
        observable: observable.into(),
        entry,
        states: vec![state],
        values: vec![value],
        deviation,
    };
    for (recorded, said) in [
        (seen("colour", 0, 1, 0.0, 1.0), "colour"),
        (seen("rotations", 0, 1, 0.0, 1.0), "attitudes"),
        (seen("attitudes", 9, 1, 0.0, 1.0), "under 9"),
        (seen("attitudes", 1, 151, 0.0, 1.0), "at most 150"),
        (seen("attitudes", 1, 1, f64::NAN, 1.0), "finite"),
        (seen("attitudes", 1, 1, 0.0, 0.0), "deviation"),
    ] {
        refused(&[bare.clone().saw(recorded)], &good, &[said]);
    }
    let settings = IdentifySettings {
        loss: Loss::Huber(-1.0),
        ..settings
    };
    says(
        identify(&runs, &good, &settings, go).unwrap_err(),
        &["loss"],
    );
}

/// A bound that correlated unknowns lean on: the least misfit within it, from wherever the search begins, and however it is damped.
#[test]
fn bounds_are_no_ends() {
    let runs = experiments(NOISE, 8);
    let settings = IdentifySettings {
        profiles: 0,
        ..IdentifySettings::default()
    };
    let costs = [
        (0.2, 0.3, 1e-3),
        (0.09, 0.02, 1e-3),
        (0.15, 0.1, 1e-3),
        (0.2, 0.3, 1e6),
    ]
    .map(|(roll, pitch, damping)| {
        let unknowns = [
            Unknown::new(NAMES[0]).start(-0.012).within(-0.05, -0.0102),
            Unknown::new(NAMES[2]).start(roll).within(0.08, 0.3),
            Unknown::new(NAMES[3]).start(pitch).within(0.01, 0.5),
        ];
        let settings = IdentifySettings {
            damping,
            ..settings
        };
        let found = identify(&runs, &unknowns, &settings, |_| ControlFlow::Continue(())).unwrap();
        assert!(found.unknowns[0].at_bound && found.unknowns[0].of_prior.is_none());
        assert!(
            matches!(found.stop, IdentifyStop::Cost | IdentifyStop::Step),
            "{:?}",
            found.stop
        );
        found.cost
    });
    for cost in costs {
        assert!((cost / costs[0] - 1.0).abs() < 1e-6, "{costs:?}");
    }
}

/// A bound holds to the bit, and is said to, though 1 + (0.3 − 1) isn't 0.3.
#[test]
fn bounds_hold_to_the_bit() {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.02;
    let axis = [1.0, 0.0, 0.0];
    let cart = Body::dry().named("cart").mass(1.0).inertia([0.1; 3]);
    scene.add(cart.joint(Joint::Prismatic { axis }));
    let simulator = Simulator::new(&scene, Settings::default()).unwrap();
    let controls = Controls::zeros(&simulator, 5);
    let run = Experiment::new("rest", simulator, controls).saw(Recorded {
        observable: "positions".into(),
        entry: 0,
        states: vec![5],
        values: vec![0.1],
        deviation: 1e-3,
    });
    let place = Unknown::new("place").sets_start("cart.position", 1.0);
    let place = place.start(1.0).within(0.3, 2.0);
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let made = identify(&[run], &[place], &settings, go).unwrap();
    let found = &made.unknowns[0];
    assert!(found.at_bound && found.value == 0.3, "{made:?}");
    assert_eq!(found.standard_error, 0.0);
}

/// A value of zero is known as well as any other, and a loss that forgives outliers says that the rest is noise.
#[test]
fn errors_have_no_scale() {
    let runs = experiments(NOISE, 9);
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let unknowns = [Unknown::new(NAMES[1]).start(1e-9), Unknown::new(NAMES[0])];
    let found = identify(&runs, &unknowns, &settings, go).unwrap();
    let [zero, other] = [&found.unknowns[0], &found.unknowns[1]];
    assert!(zero.standard_error < 1e-3 && zero.value.abs() < 4.0 * zero.standard_error);
    assert!(other.standard_error < 1e-3);
    let mut wrong = runs.clone();
    let simulator = vehicle(0.4);
    let controls = Controls::zeros(&simulator, STEPS);
    let attitudes = simulator
        .rollout(&controls)
        .unwrap()
        .observe("attitudes")
        .unwrap();
    let states: Vec<usize> = (1..=STEPS).collect();
    let off = |n: &usize| attitudes[(0, *n)] + f64::from(u8::from(n.is_multiple_of(10))) * 0.5;
    wrong.push(
        Experiment::new("outliers", simulator, controls).saw(Recorded {
            observable: "attitudes".into(),
            entry: 0,
            values: states.iter().map(off).collect(),
            states,
            deviation: NOISE,
        }),
    );
    let robust = IdentifySettings {
        loss: Loss::Cauchy(3.0),
        ..settings
    };
    let found = identify(&wrong, &unknowns, &robust, go).unwrap();
    assert!(
        found.chi_squared < 2.0 && found.inflation < 2.0,
        "{found:?}"
    );
}

/// Functions must give as many residuals as before, and may fail for good.
#[test]
fn functions_are_held_to_their_word() {
    // As many residuals as the function has been called times before, from a first number on.
    let run = |first: usize, more: usize| {
        let simulator = vehicle(0.4);
        let controls = Controls::zeros(&simulator, STEPS);
        let calls = AtomicUsize::new(0);
        let of = move |a: &[DMatrix<f64>]| {
            let count = first + more * calls.fetch_add(1, Ordering::Relaxed);
            Ok(DVector::from_element(count, a[0][(0, 0)]))
        };
        Experiment::new("run", simulator, controls).saw_function(&["attitudes"], vec![STEPS], of)
    };
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let unknowns = [Unknown::new(NAMES[0])];
    let error = identify(&[run(0, 0)], &unknowns, &settings, go).unwrap_err();
    says(error, &["attitudes", "at least one"]);
    let error = identify(&[run(1, 1)], &unknowns, &settings, go).unwrap_err();
    says(error, &["attitudes", "as many as before, 1"]);
    let scaled = experiments(0.0, 10).swap_remove(0).scaled("hull.mass", 2.0);
    says(
        identify(&[scaled], &unknowns, &settings, go).unwrap_err(),
        &["hull.mass", "no unknown"],
    );
}

/// A scale of what isn't a parameter is refused: nothing would heed it.
#[test]
fn only_parameters_are_scaled() {
    let settings = IdentifySettings::default();
    let go = |_: &_| ControlFlow::Continue(());
    let run = experiments(0.0, 11).swap_remove(0);
    let run = run.scaled("mount.angle", -1.0);
    let zero = Unknown::new("zero").sets_start("mount.angle", 1.0);
    let both = [zero, Unknown::new(NAMES[0])];
    let error = identify(&[run], &both, &settings, go).unwrap_err();
    says(error, &["scale", "mount.angle", NAMES[0], "not starts"]);
    let ball = [0.04, 0.04, 0.04, 0.0, 0.0, 0.0];
    let name = "top.inertia.root.xx";
    let run = tumbled(ball, ball, 0.0).scaled(name, 2.0);
    let error = identify(&[run], &Unknown::inertia("top"), &settings, go).unwrap_err();
    says(error, &["scale", name, "roots of inertias"]);
}

/// A residual alone, which the reverse sweep differentiates, and the same eight times over with as much less weight, which forward mode does: the same values and errors, 1e-9.
#[test]
fn both_modes_say_the_same() {
    let found = [1, 8].map(|times| {
        let simulator = vehicle(0.4);
        let controls = Controls::zeros(&simulator, STEPS);
        let run = Experiment::new("run", simulator, controls).start_within(0.0, 0.1);
        let run = run.saw(Recorded {
            observable: "attitudes".into(),
            entry: 1,
            states: vec![120; times],
            values: vec![0.02; times],
            deviation: NOISE * (times as f64).sqrt(),
        });
        let unknowns = [
            Unknown::new(NAMES[0]).prior(-0.012, 0.002),
            Unknown::new("zero")
                .sets_start("mount.angle", 1.0)
                .prior(0.0, 0.1),
        ];
        let go = |_: &_| ControlFlow::Continue(());
        identify(&[run], &unknowns, &IdentifySettings::default(), go).unwrap()
    });
    for (a, b) in found[0].unknowns.iter().zip(&found[1].unknowns) {
        assert!(
            (a.value - b.value).abs() < 1e-9 * a.standard_error,
            "{a:?} {b:?}"
        );
        assert!(
            (a.standard_error / b.standard_error - 1.0).abs() < 1e-9,
            "{a:?} {b:?}"
        );
    }
    let velocities = [0, 1].map(|k: usize| DVector::from_vec(found[k].starts[0].1.clone()));
    assert!(
        (&velocities[0] - &velocities[1]).amax() < 1e-9 && velocities[0].rows(0, 6).norm() > 0.0
    );
}

/// A dry body that a torque about its three axes tumbles, with the inertia `inertia`.
fn tumbler(inertia: [f64; 6]) -> Simulator {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.02;
    let body = Body::dry().named("top").mass(2.0);
    let mut body = body.joint(Joint::Spherical).actuated();
    body.inertia = Some(inertia.to_vec());
    scene.add(body);
    Simulator::new(&scene, Settings::default()).unwrap()
}

/// What a gyroscope on it sees, with noise, and another simulator's start.
fn tumbled(truth: [f64; 6], start: [f64; 6], noise: f64) -> Experiment {
    let (simulator, mut random) = (tumbler(truth), Samples::new(5));
    let push = DMatrix::from_fn(3, STEPS, |i, n| {
        0.2 * (0.13 * n as f64 + 2.0 * i as f64).sin()
    });
    let controls = Controls::from_matrix(&simulator, push.clone()).unwrap();
    let rollout = simulator.rollout(&controls).unwrap();
    let gyros = rollout.observe("gyros").unwrap();
    let guessed = tumbler(start);
    let controls = Controls::from_matrix(&guessed, push).unwrap();
    let mut out = Experiment::new("tumbling", guessed, controls);
    let states: Vec<usize> = (1..=STEPS).collect();
    for entry in 0..3 {
        let values = states
            .iter()
            .map(|n| gyros[(entry, *n)] + noise * random.normal())
            .collect();
        out = out.saw(Recorded {
            observable: "gyros".into(),
            entry,
            values,
            states: states.clone(),
            deviation: noise.max(1e-6),
        });
    }
    out
}

/// The inertia of a body near a plate's, from a ball's: by its root every trial on the way is physical. Without noise to 1e-6, with it within four standard errors of the root's entries; entries that
/// aren't asked for stay; what has no root, and an inertia set twice, are refused.
#[test]
fn an_inertia_stays_physical() {
    let truth = [0.030, 0.041, 0.069, 0.002, -0.0015, 0.003];
    let ball = [0.04, 0.04, 0.04, 0.0, 0.0, 0.0];
    let all = Unknown::inertia("top");
    let settings = IdentifySettings::default();
    let run = |experiment: Experiment, unknowns: &[Unknown]| {
        identify(&[experiment], unknowns, &settings, |_| {
            ControlFlow::Continue(())
        })
    };
    let found = run(tumbled(truth, ball, 0.0), &all).unwrap();
    let parameters = found.parameters(&tumbler(ball)).unwrap();
    for (entry, expected) in ["xx", "yy", "zz", "xy", "xz", "yz"].iter().zip(truth) {
        let got = parameters.get(&format!("top.inertia.{entry}")).unwrap();
        assert!((got - expected).abs() < 1e-6, "{entry}: {got} {expected}");
    }
    assert_eq!(found.failures, 0, "{found:?}");
    let exact: Vec<f64> = found.unknowns.iter().map(|u| u.value).collect();
    let noisy = run(tumbled(truth, ball, 5e-3), &all).unwrap();
    for (u, exact) in noisy.unknowns.iter().zip(exact) {
        let off = (u.value - exact).abs() / u.standard_error;
        assert!(
            off < 4.0,
            "{}: {} of {exact}, {off} errors",
            u.name,
            u.value
        );
    }
    assert!(
        (0.8..1.25).contains(&noisy.chi_squared),
        "{}",
        noisy.chi_squared
    );
    // Three of six: a body whose axes are known.
    let axes = [0.03, 0.041, 0.06, 0.0, 0.0, 0.0];
    let found = run(tumbled(axes, ball, 0.0), &all[..3]).unwrap();
    let parameters = found.parameters(&tumbler(ball)).unwrap();
    assert!((parameters.get("top.inertia.zz").unwrap() - 0.06).abs() < 1e-6);
    assert_eq!(parameters.get("top.inertia.xy").unwrap(), 0.0);

    let plate = [0.02, 0.02, 0.04, 0.0, 0.0, 0.0];
    let refused = run(tumbled(truth, plate, 0.0), &all).unwrap_err();
    says(refused, &["\"top\"", "plate", "root"]);
    let twice = [all[0].clone(), Unknown::new("top.inertia.yy")];
    let refused = run(tumbled(truth, ball, 0.0), &twice).unwrap_err();
    says(refused, &["top.inertia.root.xx", "top.inertia.yy", "root"]);
    let nobody = run(tumbled(truth, ball, 0.0), &Unknown::inertia("nobody")).unwrap_err();
    says(nobody, &["nobody.inertia.xx"]);
}

/// What an encoder tells of a joint on a vehicle that floats, whose place is no plain number: the joint's coordinate itself.
#[test]
fn encoders_of_floating_robots_tell() {
    let made = |damping: f64| {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.time_step = 0.02;
        let hull = Shape::ellipsoid([0.2, 0.15, 0.12]).faces(80);
        scene.add(Body::new(hull).named("hull").density(998.0));
        let axis = [0.0, 1.0, 0.0];
        let arm = Body::new(Shape::ellipsoid([0.12, 0.03, 0.03]).faces(80));
        let arm = arm.named("arm").child_of("hull").density(1400.0);
        let passive = hydrograd::scene::Passive::default().damping(damping);
        scene.add(
            arm.at([0.35, 0.0, 0.0])
                .joint(Joint::Revolute { axis })
                .passive(passive.stiffness(0.5)),
        );
        scene.initial.v = vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0];
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let settings = settings.integrator(hydrograd::dynamics::Integrator::Rk4);
        Simulator::new(&scene, settings).unwrap()
    };
    let simulator = made(0.02);
    let controls = Controls::zeros(&simulator, 60);
    let rollout = simulator.rollout(&controls).unwrap();
    let states: Vec<usize> = (1..=60).collect();
    let seen = |entry: usize| Recorded {
        observable: "q".into(),
        entry,
        states: states.clone(),
        values: states
            .iter()
            .map(|n| rollout.samples()[*n].q[entry])
            .collect(),
        deviation: 1e-6,
    };
    let run = |entry| Experiment::new("swing", made(0.05), controls.clone()).saw(seen(entry));
    let unknowns = [Unknown::new("arm.joint.damping").positive()];
    // Of few residuals by a reverse sweep for each, of many by forward mode.
    for few in [false, true] {
        let settings = IdentifySettings::default();
        let go = |_: &_| ControlFlow::Continue(());
        let mut recorded = seen(7);
        if few {
            recorded.states = vec![20];
            recorded.values = vec![rollout.samples()[20].q[7]];
        }
        let swing = Experiment::new("swing", made(0.05), controls.clone()).saw(recorded);
        let found = identify(&[swing], &unknowns, &settings, go).unwrap();
        let damping = found.unknowns[0].value;
        assert!((damping / 0.02 - 1.0).abs() < 1e-5, "{damping}");
        // The hull's place is no plain number.
        for part in [0, 3] {
            let refused = identify(&[run(part)], &unknowns, &settings, go).unwrap_err();
            says(refused, &["entry", "three dimensions", "attitudes"]);
        }
    }
    // And in an objective.
    let objective = hydrograd::objective::mean_observable("q", 7, 0.1, 1.0);
    let value = |damping: f64| {
        let rollout = made(damping).rollout(&controls).unwrap();
        objective.value(&rollout)
    };
    let found = rollout.gradient(&objective).unwrap();
    let found = found.parameters.get("arm.joint.damping").unwrap();
    let difference = (value(0.02 + 1e-6) - value(0.02 - 1e-6)) / 2e-6;
    assert!(
        (found / difference - 1.0).abs() < 1e-6,
        "{found} for {difference}"
    );
    let place = hydrograd::objective::mean_observable("q", 4, 0.1, 1.0);
    says(rollout.gradient(&place).unwrap_err(), &["three dimensions"]);
}
