//! What happens where the GPU isn't what was hoped for.

use super::fixture::context;
use super::trajectory::{STEPS, falling_ball, simulator};
use hydrograd::coupling::full::FullSolver;
use hydrograd::gpu::{Context, Options};
use hydrograd::simulate::Method;
use hydrograd::simulate::{Action, ActionBar, Backend, GpuSettings, Observation, Policy};
use hydrograd::{Controls, Error, Fidelity, Result, Settings, Simulator, objective};
use nalgebra::DVector;
use std::sync::Arc;

fn settings() -> Settings {
    Settings::default().backend(Backend::Gpu)
}

fn error(settings: Settings) -> Error {
    match Simulator::new(&falling_ball(), settings) {
        Ok(_) => panic!("an error was expected"),
        Err(error) => error,
    }
}

/// All of a device's error is there.
fn says(error: &Error, words: &[&str]) {
    assert!(matches!(error, Error::Device { .. }), "{error:?}");
    let message = error.to_string();
    for word in words {
        assert!(message.contains(word), "no {word:?} in {message}");
    }
}

fn with_fallback() -> GpuSettings {
    GpuSettings {
        fallback: true,
        ..GpuSettings::default()
    }
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    let nobody = GpuSettings {
        adapter: Some("nobody's card".parse().unwrap()),
        ..GpuSettings::default()
    };
    let wanted = settings().gpu(nobody.clone());
    let has = &context().adapter().name;
    says(
        &error(wanted.clone()),
        &["nobody's card", has, "backend cpu"],
    );

    let wanted = wanted.gpu(GpuSettings {
        fallback: true,
        ..nobody
    });
    let scene = falling_ball();
    let simulator = Simulator::new(&scene, wanted.clone()).unwrap();
    let report = simulator.backend();
    assert_eq!(
        (report.backend, report.backend_used),
        (Backend::Gpu, Backend::Cpu)
    );
    assert!(report.device.is_none() && simulator.context().is_none());
    let reason = report.backend_reason.unwrap();
    assert!(
        reason.contains("nobody's card") && reason.contains("CPU"),
        "{reason}"
    );
    assert!(simulator.warnings().contains(&reason));
    // And it is the CPU that answers.
    let cpu = Simulator::new(&scene, wanted.backend(Backend::Cpu)).unwrap();
    let mass = |s: &Simulator| s.added_mass().unwrap().matrix;
    assert_eq!(mass(&simulator), mass(&cpu));
}

#[test]
fn an_adapter_is_found_by_part_of_its_name() {
    let has = &context().adapter().name;
    // In another case, and without its ends.
    let part: String = has.chars().skip(1).take(40).collect();
    let options = Options {
        adapter: Some(part.to_uppercase()),
        ..Options::default()
    };
    assert_eq!(&Context::new(&options).unwrap().adapter().name, has);
}

#[test]
fn what_the_gpu_has_no_part_in_runs_on_the_cpu_or_is_refused() {
    let alone = settings().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&falling_ball(), alone).unwrap();
    let report = simulator.backend();
    assert_eq!(report.backend_used, Backend::Cpu);
    assert!(simulator.context().is_none());
    let warnings = simulator.warnings().join("\n");
    assert!(warnings.contains("nothing to compute"), "{warnings}");

    // A fallback is for devices that fail, not for what isn't offered.
    let wanted = settings().fidelity(Fidelity::Full).gpu(with_fallback());
    let dense = wanted.solver(FullSolver::Qr);
    for method in [Method::Panel, Method::MfsVertex] {
        let found = error(dense.clone().method(method));
        assert!(matches!(found, Error::Unsupported { .. }), "{found:?}");
        let message = found.to_string();
        assert!(
            message.contains("Qr") && message.contains("backend cpu"),
            "{message}"
        );
    }
}

#[test]
fn settings_without_effect_are_told() {
    let cpu = settings().backend(Backend::Cpu).gpu(with_fallback());
    let simulator = Simulator::new(&falling_ball(), cpu).unwrap();
    let warnings = simulator.warnings().join("\n");
    assert!(warnings.contains("no effect with the backend cpu"));
}

/// Pulls the plug at a step.
struct Unplug {
    context: Arc<Context>,
    step: usize,
}

impl Policy for Unplug {
    fn act(&self, observed: &Observation) -> hydrograd::Result<Action> {
        if observed.step == self.step {
            self.context.lose();
        }
        Ok(Action::default())
    }

    fn act_vjp(&self, _: &Observation, _: &DVector<f64>) -> hydrograd::Result<ActionBar> {
        Ok(ActionBar::default())
    }

    fn with_gains(&self, _: &[f64]) -> Result<Box<dyn Policy>> {
        Ok(Box::new(Self {
            context: self.context.clone(),
            step: self.step,
        }))
    }
}

#[test]
fn a_device_lost_on_the_way_is_an_error_with_its_time() {
    let mut lost = simulator(Backend::Gpu, 1e-8);
    let context = lost.context().unwrap().clone();
    let step = 2;
    lost.set_policy(Box::new(Unplug {
        context: context.clone(),
        step,
    }));
    let name = &context.adapter().name;
    let controls = Controls::zeros(&lost, STEPS);
    let found = lost.rollout(&controls).err().unwrap();
    // The step's second stage is the first that finds out.
    says(&found, &[name, "lost", "t = 0.02 s", "backend cpu"]);
    // From then on nothing works, and nothing panics.
    let found = lost.rollout(&controls).err().unwrap();
    says(&found, &[name, "lost", "t = 0 s"]);
    says(&lost.added_mass().err().unwrap(), &[name, "lost"]);
}

#[test]
fn a_device_lost_before_the_gradient_is_an_error_with_its_time() {
    let simulator = simulator(Backend::Gpu, 1e-8);
    let controls = Controls::zeros(&simulator, STEPS);
    let rollout = simulator.rollout(&controls).unwrap();
    simulator.context().unwrap().lose();
    let goal = objective::final_coordinate(1, 0.7, 1.0);
    let found = rollout.gradient(&goal).err().unwrap();
    let end = format!("t = {} s", rollout.samples()[STEPS].time);
    says(&found, &["lost", &end]);
}

#[test]
fn threads_share_a_device() {
    let simulator = simulator(Backend::Gpu, 1e-8);
    let controls = Controls::zeros(&simulator, 2);
    let run = || {
        let rollout = simulator.rollout(&controls).unwrap();
        (rollout.q(), rollout.v())
    };
    let alone = run();
    let together = std::thread::scope(|scope| {
        let threads = [scope.spawn(run), scope.spawn(run), scope.spawn(run)];
        threads.map(|t| t.join().unwrap())
    });
    assert!(together.iter().all(|t| *t == alone));
}
