//! On the GPU a rollout and its gradient leave no pair work and no solver vectors to the CPU, and it
//! waits for numbers as often whatever the tolerance.
//!
//! The counters are the process's: the test runs in a process of its own.

use super::trajectory::falling_ball;
use hydrograd::adjoint::count::PAIRS;
use hydrograd::simulate::{Backend, Method};
use hydrograd::solver::CALLS;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use std::process::Command;

/// What a rollout with its gradient costs the CPU, after the set-up: pairs and calls of solvers.
fn work(simulator: &Simulator) -> (u64, u64) {
    let before = (PAIRS.total(), CALLS.total());
    let controls = Controls::zeros(simulator, 3);
    let rollout = simulator.rollout(&controls).unwrap();
    let goal = objective::final_coordinate(1, 0.7, 1.0);
    let gradient = rollout.gradient(&goal).unwrap();
    assert!(gradient.controls.norm() > 0.0);
    (PAIRS.total() - before.0, CALLS.total() - before.1)
}

/// In the child that [`the_gpu_does_the_work`] starts.
const ALONE: &str = "HYDROGRAD_TEST_ALONE";

#[test]
fn the_gpu_does_the_work() {
    if std::env::var_os(ALONE).is_some() {
        return count();
    }
    let name = "counters::the_gpu_does_the_work";
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(ALONE, "1")
        .output()
        .unwrap();
    let out = String::from_utf8_lossy(&child.stdout);
    let errors = String::from_utf8_lossy(&child.stderr);
    assert!(child.status.success(), "{out}{errors}");
    assert!(out.contains("1 passed"), "{out}");
}

fn count() {
    let scene = falling_ball();
    let settings = Settings::default();

    let cpu = Simulator::new(&scene, settings.clone()).unwrap();
    let (pairs, calls) = work(&cpu);
    println!("cpu: {pairs} pairs, {calls} calls");
    assert!(pairs > 0 && calls > 0, "the counters count");

    let read_backs = |method: Method, tolerance: f64| {
        let settings = settings.clone().fidelity(Fidelity::Full).method(method);
        let settings = settings.backend(Backend::Gpu).tolerance(tolerance);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let counts = || simulator.context().unwrap().counts();
        let before = counts();
        let done = work(&simulator);
        let after = counts();
        println!("{method:?}, {tolerance:e}: {after:?}");
        assert_eq!(done, (0, 0), "pairs and calls of solvers on the CPU");
        assert!(after.dispatches > before.dispatches);
        after.read_backs - before.read_backs
    };
    for method in [Method::MfsVertex, Method::Panel] {
        assert_eq!(
            read_backs(method, 1e-4),
            read_backs(method, 1e-9),
            "{method:?}"
        );
    }

    let settings = settings.fidelity(Fidelity::Reduced).backend(Backend::Gpu);
    let (pairs, calls) = work(&Simulator::new(&scene, settings).unwrap());
    assert_eq!((pairs, calls), (0, 0), "compressed bodies");
}
