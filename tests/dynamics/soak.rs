//! Long runs in parts: memory doesn't grow with the number of steps, and the energy's error no faster than a walk of steps whose errors have either sign.
//!
//! The motion is chaotic: changes of 1e-13 in the start give largest errors of 0.8e-4 to 1.7e-4 in 10⁵ steps (six runs), 0.6e-4 in 2 · 10⁴, 2.1e-4 and 2.6e-4 in
//! 4 · 10⁵. An error that grew with the steps would be 3e-4 in 10⁵.
//!
//! `HYDROGRAD_SOAK_STEPS=1000000 cargo test --release --test dynamics soak -- --nocapture` for a long one.

use hydrograd::dynamics::Integrator;
use hydrograd::{Body, Controls, Fidelity, Fluid, Scene, Settings, Shape, Simulator};
use std::ops::ControlFlow;
use std::process::Command;

const VARIABLE: &str = "HYDROGRAD_SOAK_STEPS";
/// Steps of a part.
const PART: usize = 1000;

/// Largest memory held so far, bytes.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find_map(|l| l.strip_prefix("VmHWM:"))
        .unwrap();
    let kib: f64 = line.trim().trim_end_matches(" kB").parse().unwrap();
    1024.0 * kib
}

/// In a process of its own, which nothing else fills.
#[test]
#[cfg(target_os = "linux")]
#[ignore = "run by the test below"]
fn parts() {
    let steps: usize = std::env::var(VARIABLE).unwrap().parse().unwrap();
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(Shape::ellipsoid([0.1, 0.06, 0.04]).faces(80)).density(1100.0));
    scene.initial.v = vec![0.1, -0.2, 0.05, 1.0, 0.5, -0.8];
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(Integrator::Midpoint);
    let simulator = Simulator::new(&scene, settings.time_step(0.01)).unwrap();
    let controls = Controls::zeros(&simulator, PART);
    let mut state = simulator.initial().unwrap();
    let (mut first, mut energy, mut worst) = (0.0, 0.0, 0.0_f64);
    for part in 0..steps / PART {
        let go_on = |_| ControlFlow::Continue(());
        let rollout = simulator.rollout_from(&state, &controls, go_on).unwrap();
        if part == 0 {
            energy = rollout.samples()[0].energy();
        }
        let errors = rollout
            .samples()
            .iter()
            .map(|s| (s.energy() / energy - 1.0).abs());
        worst = errors.fold(worst, f64::max);
        state = rollout.states()[PART].clone();
        if part == 9 {
            first = peak();
        }
    }
    let grown = peak() - first;
    println!("{steps} steps: {grown:e} bytes more than {first:e}, energy within {worst:e}");
    // What the allocator keeps levels off at 9 MB; a state kept per step would be 100 MB.
    assert!(grown < 16e6, "{grown:e}");
    let walked = 8e-7 * (steps as f64).sqrt();
    assert!(worst > 0.0 && worst < walked, "{worst:e}");
}

#[test]
#[cfg(target_os = "linux")]
fn memory_and_energy_are_bounded_over_many_steps() {
    let steps = std::env::var(VARIABLE).unwrap_or("100000".into());
    let done = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "soak::parts", "--ignored", "--nocapture"])
        .env(VARIABLE, steps)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stdout);
    println!("{said}");
    assert!(
        done.status.success() && said.contains("bytes more than"),
        "{said}{}",
        String::from_utf8_lossy(&done.stderr)
    );
}
