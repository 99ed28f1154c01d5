//! Gradients of runs a part at a time: those of the whole rollout to the bit, in bounded memory; and what is told of gradients that grow out of all proportion.
//!
//! `HYDROGRAD_LONG_STEPS=1000000 cargo test --release --test dynamics parts -- --nocapture` for a long one.

use crate::support::{INTEGRATORS, example, says, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{BodyId, Drag, DragPart};
use hydrograd::simulate::{Checkpoints, LEAST_STATES, Partwise};
use hydrograd::{
    Body, Controls, Error, Fidelity, Fluid, Gradient, Scene, Settings, Shape, Simulator, objective,
};
use nalgebra::DMatrix;
use std::ops::ControlFlow;
use std::process::Command;
use std::time::Instant;

fn goal() -> objective::Sum {
    objective::final_position(BodyId(0), [0.1, 0.2, -0.3])
        + objective::mean_position(BodyId(0), [0.0, 0.1, 0.0]).scaled(0.3)
        + objective::final_velocity(1, 0.2, 0.5)
        + objective::final_observable("angular_momentum", 0, 0.1, 0.2)
        + objective::effort(1e-3)
}

fn same(a: &Gradient, b: &Gradient) {
    assert_eq!(a.controls, b.controls);
    assert_eq!(a.initial, b.initial);
    assert_eq!(a.parameters.to_vec(), b.parameters.to_vec());
    assert_eq!(a.gains, b.gains);
}

fn compare(simulator: &Simulator, steps: usize, what: &str) {
    let count = simulator.system().controls;
    let u = DMatrix::from_fn(count, steps, |i, n| 1e-3 * ((3 * i + n) as f64).sin());
    let controls = Controls::from_matrix(simulator, u).unwrap();
    let rollout = simulator.rollout(&controls).unwrap();
    let whole = rollout.gradient(&goal()).unwrap();
    let value = rollout.value(&goal()).unwrap();
    for (part, states) in [(1, 2), (3, 100), (5, 1), (7, 3), (1000, 1)] {
        let kept = Checkpoints { part, states };
        let mut told = 0;
        let found = simulator.gradient_in_parts(&controls, &goal(), kept, |done| {
            told = done;
            ControlFlow::Continue(())
        });
        assert_eq!(told, kept.work(steps), "{what}");
        let found = found.unwrap();
        same(&found.gradient, &whole);
        assert!((found.value - value).abs() <= 1e-14 * value.abs(), "{what}");
        assert!(found.made >= steps);
    }
}

#[test]
fn gradients_in_parts_are_the_whole_ones_to_the_bit() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    let drag = Drag {
        quadratic: 1.0,
        quadratic_part: DragPart::Total,
        ..Drag::default()
    };
    let ball = Body::new(Shape::ellipsoid([0.1, 0.07, 0.05]).faces(80)).density(1200.0);
    scene.add(ball.actuated().drag(drag));
    scene.initial.v = vec![0.1, -0.2, 0.3, 1.0, 0.5, -0.7];
    for integrator in INTEGRATORS {
        let simulator = simulator(&scene, Fidelity::Isolated, integrator);
        compare(&simulator, 23, &format!("{integrator:?}"));
    }
    // A controller with stages, coupled; and contact.
    for name in ["coins", "grasp"] {
        let simulator = Simulator::new(&example(name), Settings::default()).unwrap();
        compare(&simulator, 17, name);
    }
}

#[test]
fn checkpoints_fit_what_they_are_given() {
    let simulator = simulator(&example("coins"), Fidelity::Isolated, Integrator::Rk4);
    for bytes in [1e5, 1e6, 1e12] {
        let kept = Checkpoints::within(&simulator, 100_000, bytes).unwrap();
        assert!(kept.part >= 1 && kept.states >= 1);
        assert!(kept.part <= 100_000 && (kept.states - 1) * kept.part < 100_000);
        assert!(bytes > 1e11 || kept.states >= LEAST_STATES);
    }
    let all = Checkpoints::within(&simulator, 100_000, 1e12).unwrap();
    assert_eq!((all.part, all.states), (100_000, 1));
    // With one state each part would begin at the start again.
    for bytes in [1.0, 1e3, f64::NAN, f64::INFINITY] {
        let error = Checkpoints::within(&simulator, 100_000, bytes).unwrap_err();
        let bytes = format!("{bytes} bytes");
        says(error, &["memory of a gradient", &bytes, "at least"]);
    }
    assert_eq!(
        Checkpoints::new(100),
        Checkpoints {
            part: 10,
            states: 10
        }
    );
    let none = Checkpoints { part: 0, states: 1 };
    let controls = Controls::zeros(&simulator, 3);
    let go_on = |_| ControlFlow::Continue(());
    let error = simulator.gradient_in_parts(&controls, &goal(), none, go_on);
    assert!(matches!(error, Err(Error::Input { .. })));
    let kept = Checkpoints { part: 1, states: 2 };
    let all = kept.work(3);
    let stop = |done| match 2 * done > all {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let error = simulator.gradient_in_parts(&controls, &goal(), kept, stop);
    assert!(matches!(error, Err(Error::Stopped { .. })));
}

/// Before anything of their size is made.
#[test]
fn more_steps_than_any_run_takes_are_refused() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(Shape::sphere(0.1).faces(80)).density(1000.0));
    let still = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    // More than a rollout keeps: for runs in parts, and so not cut.
    let long = Controls::none(&still, 6_000_000).unwrap();
    assert_eq!(long.steps(), 6_000_000);
    let error = still.rollout(&long).err().expect("an error");
    says(error, &["steps", "at most 5000000", "in parts"]);
    for steps in [2_000_000_000, usize::MAX] {
        let count = steps.to_string();
        let words = ["controls: steps", count.as_str(), "at most 1000000000"];
        says(Controls::none(&still, steps).unwrap_err(), &words);
        let empty = DMatrix::zeros(0, steps);
        says(Controls::from_matrix(&still, empty).unwrap_err(), &words);
    }
}

const STEPS: &str = "HYDROGRAD_LONG_STEPS";
const IN_PARTS: &str = "HYDROGRAD_IN_PARTS";

fn held(key: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|l| l.strip_prefix(key)).unwrap();
    let kib: f64 = line.trim().trim_end_matches(" kB").parse().unwrap();
    1024.0 * kib
}

/// In a process of its own, which nothing else fills.
#[test]
#[cfg(target_os = "linux")]
#[ignore = "run by the test below"]
fn long_gradient() {
    let steps: usize = std::env::var(STEPS).unwrap().parse().unwrap();
    let in_parts = std::env::var(IN_PARTS).unwrap() == "1";
    let mut scene = Scene::new(Fluid::fresh_water());
    let body = Body::new(Shape::ellipsoid([0.1, 0.06, 0.04]).faces(80)).density(1100.0);
    scene.add(body.drag(Drag {
        linear: 5.0,
        ..Drag::default()
    }));
    scene.initial.v = vec![0.1, -0.2, 0.05, 1.0, 0.5, -0.8];
    let simulator = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let controls = Controls::zeros(&simulator, steps);
    let goal = objective::final_position(BodyId(0), [0.0; 3]);
    let before = held("VmRSS:");
    let begun = Instant::now();
    let gradient = match in_parts {
        true => {
            let kept = Checkpoints::new(steps);
            let go_on = |_| ControlFlow::Continue(());
            let found = simulator
                .gradient_in_parts(&controls, &goal, kept, go_on)
                .unwrap();
            println!("made {} steps", found.made);
            found.gradient
        }
        false => simulator
            .rollout(&controls)
            .unwrap()
            .gradient(&goal)
            .unwrap(),
    };
    let took = begun.elapsed().as_secs_f64();
    let grown = held("VmHWM:") - before;
    println!(
        "long gradient: {grown:e} bytes, {took:.3} s, {:?}",
        gradient.initial.v.as_slice()
    );
}

#[test]
#[cfg(target_os = "linux")]
fn memory_of_a_long_gradient_is_bounded() {
    let steps = std::env::var(STEPS).unwrap_or("20000".into());
    let run = |in_parts: &str| {
        let done = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "parts::long_gradient",
                "--ignored",
                "--nocapture",
            ])
            .env(STEPS, &steps)
            .env(IN_PARTS, in_parts)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stdout).into_owned();
        assert!(done.status.success(), "{said}");
        let line = said.lines().find(|l| l.contains("long gradient:")).unwrap();
        println!("{steps} steps, in parts {in_parts}: {line}");
        let (_, numbers) = line.split_once("long gradient: ").unwrap();
        let bytes: f64 = numbers.split(' ').next().unwrap().parse().unwrap();
        let (_, gradient) = numbers.split_once(" s, ").unwrap();
        (bytes, gradient.to_string())
    };
    let ((whole, gradient), (parts, same)) = (run("0"), run("1"));
    assert_eq!(gradient, same);
    // 150 parts of 142 steps.
    assert!(parts < 8e6 && parts < 0.2 * whole, "{parts:e} of {whole:e}");
}

/// A sphere at rest with linear drag, and a gradient of where it ends with respect to its velocity.
fn dragged(linear: f64, integrator: Integrator) -> Gradient {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = Body::new(Shape::sphere(0.1).faces(80)).density(1500.0);
    scene.add(ball.drag(Drag {
        linear,
        part: DragPart::Total,
        ..Drag::default()
    }));
    let simulator = simulator(&scene, Fidelity::Isolated, integrator);
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 40)).unwrap();
    rollout
        .gradient(&objective::final_position(BodyId(0), [1.0, 0.0, 0.0]))
        .unwrap()
}

#[test]
fn gradients_that_grow_without_bound_are_told() {
    // The run is at rest, so that it shows nothing.
    let told = dragged(1e6, Integrator::Rk2).warnings;
    assert_eq!(told.len(), 1);
    assert!(
        told[0].contains("back from step") && told[0].contains("smaller time step"),
        "{}",
        told[0]
    );
    for (linear, integrator) in [(1e6, Integrator::Midpoint), (20.0, Integrator::Rk2)] {
        assert!(
            dragged(linear, integrator).warnings.is_empty(),
            "{linear} {integrator:?}"
        );
    }
}

#[test]
fn gradients_of_the_examples_are_not_told() {
    for path in crate::support::example_scenes() {
        let scene = Scene::load(&path).unwrap();
        let settings = Settings::default().fidelity(Fidelity::Isolated).faces(80);
        let Ok(simulator) = Simulator::new(&scene, settings) else {
            continue;
        };
        let steps = scene.steps.min(60);
        let Ok(rollout) = simulator.rollout(&Controls::zeros(&simulator, steps)) else {
            continue;
        };
        for goal in [
            objective::final_position(BodyId(0), [0.1; 3]),
            objective::mean_position(BodyId(0), [0.1; 3]),
        ] {
            let gradient = rollout.gradient(&goal).unwrap();
            assert!(
                gradient.warnings.is_empty(),
                "{path:?}: {:?}",
                gradient.warnings
            );
        }
    }
}

/// What objectives of parts have in common.
#[test]
fn objectives_that_do_not_fit_are_refused_in_parts_too() {
    let simulator = simulator(&example("coins"), Fidelity::Isolated, Integrator::Rk4);
    let controls = Controls::zeros(&simulator, 4);
    let goals: [&dyn Partwise; 2] = [
        &objective::final_position(BodyId(77), [0.0; 3]),
        &objective::final_position("nobody", [0.0; 3]),
    ];
    for goal in goals {
        let found = simulator.gradient_in_parts(&controls, goal, Checkpoints::new(4), |_| {
            ControlFlow::Continue(())
        });
        assert!(matches!(found, Err(Error::Input { .. })));
    }
}
