//! Prints the tables of `docs/integrators.md`: energy, momentum and cost of every integrator over the example
//! scenes. `cargo run --release --example integrators [FACES [SCENE]]`, by default with 320 faces a body.

use hydrograd::adjoint::lie::Vec6;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::Scene;
use hydrograd::simulate::Sample;
use hydrograd::{Controls, Fidelity, Result, Rollout, Settings, Simulator};
use std::path::Path;
use std::time::Instant;

const INTEGRATORS: [(Integrator, &str); 6] = [
    (Integrator::MomentumEuler, "momentum Euler"),
    (Integrator::EnergyEuler, "energy Euler"),
    (Integrator::Midpoint, "midpoint"),
    (Integrator::Rk2, "RK2"),
    (Integrator::Rk4, "RK4"),
    (Integrator::VelocityEuler, "velocity Euler"),
];

fn scene(name: &str) -> Result<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    Scene::load(folder.join(format!("{name}.toml")))
}

/// Largest change of the total momentum, linear or angular, against the largest momentum of one body;
/// an angular momentum counts at least as much as the linear one at an arm of the bodies' size.
fn momentum_drift(rollout: &Rollout) -> f64 {
    let s = rollout.samples();
    let bodies = &rollout.simulator().system().bodies;
    let size = bodies
        .iter()
        .map(|b| b.volume.cbrt())
        .fold(0.0_f64, f64::max);
    let largest = |at: usize, h: &dyn Fn(&Sample) -> Vec6| {
        s.iter()
            .map(|s| h(s).fixed_rows::<3>(at).amax())
            .fold(0.0_f64, f64::max)
    };
    let linear = largest(0, &|s| s.largest_momentum);
    let angular = largest(3, &|s| s.largest_momentum).max(size * linear);
    let change = |s: &Sample| s.momentum - rollout.samples()[0].momentum;
    (largest(0, &change) / linear).max(largest(3, &change) / angular)
}

/// Largest energy error relative to the largest energy.
fn energy_error(rollout: &Rollout) -> f64 {
    let s = rollout.samples();
    let scale = s.iter().map(|s| s.energy().abs()).fold(0.0, f64::max);
    let changes = s.iter().map(|x| (x.energy() - s[0].energy()).abs());
    changes.fold(0.0, f64::max) / scale
}

/// Largest difference of the energy from a converged run's with `ratio` times as many steps, relative to the largest energy.
fn energy_difference(rollout: &Rollout, converged: &Rollout, ratio: usize) -> f64 {
    let (s, c) = (rollout.samples(), converged.samples());
    let scale = c.iter().map(|s| s.energy().abs()).fold(0.0, f64::max);
    let differences = (0..s.len()).map(|n| (s[n].energy() - c[ratio * n].energy()).abs());
    differences.fold(0.0, f64::max) / scale
}

/// One row; `first` is the time of the first integrator.
fn row(
    scene: &str,
    integrator: &str,
    energy: f64,
    momentum: Option<f64>,
    seconds: f64,
    first: &mut f64,
) {
    if *first == 0.0 {
        *first = seconds;
    }
    let momentum = momentum.map_or("–".into(), |m| format!("{m:.0e}"));
    println!(
        "| {scene} | {integrator} | {:.4} % | {momentum} | {:.1} |",
        100.0 * energy,
        seconds / *first
    );
}

fn conserved(name: &str, fidelity: Fidelity, steps: Option<usize>, faces: usize) -> Result<()> {
    let scene = scene(name)?;
    let steps = steps.unwrap_or(scene.steps);
    let title = format!("{}, {steps} steps", scene.name);
    let mut first = 0.0;
    for (integrator, label) in INTEGRATORS {
        let settings = Settings::default().fidelity(fidelity).faces(faces);
        let simulator = Simulator::new(&scene, settings.integrator(integrator))?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
        let seconds = start.elapsed().as_secs_f64();
        let drift = Some(momentum_drift(&rollout));
        let energy = energy_error(&rollout);
        row(&title, label, energy, drift, seconds, &mut first);
    }
    Ok(())
}

/// The ball's way down, whose energy is what the push puts in: against midpoint with a quarter of the step.
/// It ends before the stop, which takes whatever energy is there at its step.
fn pushed(faces: usize) -> Result<()> {
    const RATIO: usize = 4;
    let mut scene = scene("falling_ball")?;
    scene.steps = 150;
    let title = format!("{}, {} steps", scene.name, scene.steps);
    let settings = Settings::default().fidelity(Fidelity::Full).faces(faces);
    let fine = settings
        .integrator(Integrator::Midpoint)
        .time_step(scene.time_step / RATIO as f64);
    let fine = Simulator::new(&scene, fine)?;
    let converged = fine.rollout(&Controls::zeros(&fine, RATIO * scene.steps))?;
    let mut first = 0.0;
    for (integrator, label) in INTEGRATORS {
        let simulator = Simulator::new(&scene, settings.integrator(integrator))?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, scene.steps))?;
        let seconds = start.elapsed().as_secs_f64();
        let energy = energy_difference(&rollout, &converged, RATIO);
        row(&title, label, energy, None, seconds, &mut first);
    }
    Ok(())
}

/// Observed order on the coins: errors of q and v after 0.16 s.
fn orders() -> Result<()> {
    let scene = scene("coins")?;
    let end = |integrator, steps: usize| {
        let settings = Settings::default()
            .fidelity(Fidelity::Full)
            .integrator(integrator)
            .tolerance(1e-13)
            .time_step(0.16 / steps as f64);
        let simulator = Simulator::new(&scene, settings.faces(80))?;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
        let last = &rollout.samples()[steps];
        Ok((last.q.clone(), last.v.clone()))
    };
    let reference = end(Integrator::Rk4, 128)?;
    println!("\n| integrator | error at 16 steps | 32 | order |\n|---|---|---|---|");
    for (integrator, label) in INTEGRATORS {
        let mut errors = [0.0; 2];
        for (error, steps) in errors.iter_mut().zip([16, 32]) {
            let (q, v) = end(integrator, steps)?;
            let squares = (q - &reference.0).norm_squared() + (v - &reference.1).norm_squared();
            *error = squares.sqrt();
        }
        let order = (errors[0] / errors[1]).log2();
        println!(
            "| {label} | {:.1e} | {:.1e} | {order:.2} |",
            errors[0], errors[1]
        );
    }
    Ok(())
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let faces = arguments.next().map_or(320, |f| f.parse().unwrap_or(320));
    let only = arguments.next();
    let wanted = |name: &str| only.as_deref().is_none_or(|o| o == name);
    println!(
        "| scene | integrator | energy error | momentum drift | time |\n|---|---|---|---|---|"
    );
    for name in ["coins", "two_spheres", "cube", "kirchhoff_ellipsoid"] {
        if wanted(name) {
            conserved(name, Fidelity::Full, None, faces)?;
        }
    }
    if wanted("kirchhoff_ellipsoid") {
        conserved(
            "kirchhoff_ellipsoid",
            Fidelity::Isolated,
            Some(10_000),
            faces,
        )?;
    }
    if wanted("falling_ball") {
        pushed(faces)?;
    }
    if only.is_none() {
        orders()?;
    }
    Ok(())
}
