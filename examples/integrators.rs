//! Prints the table of `docs/integrators.md`: energy, momentum and cost of every integrator over the example
//! scenes. `cargo run --release --example integrators`

use hydrograd::dynamics::Integrator;
use hydrograd::scene::Scene;
use hydrograd::{Controls, Fidelity, Result, Rollout, Settings, Simulator};
use std::path::Path;
use std::time::Instant;

const INTEGRATORS: [(Integrator, &str); 4] = [
    (Integrator::MomentumEuler, "momentum Euler"),
    (Integrator::Midpoint, "midpoint"),
    (Integrator::Rk4, "RK4"),
    (Integrator::VelocityEuler, "velocity Euler"),
];

fn scene(name: &str) -> Result<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    Scene::load(folder.join(format!("{name}.toml")))
}

fn simulator(scene: &Scene, settings: Settings) -> Result<Simulator> {
    Simulator::new(scene, settings.faces(320))
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

fn row(scene: &str, steps: usize, name: &str, energy: f64, momentum: Option<f64>, seconds: f64) {
    let momentum = momentum.map_or("forced".into(), |m| format!("{m:.0e}"));
    println!(
        "| {scene} | {steps} | {name} | {:.2} % | {momentum} | {:.2} |",
        100.0 * energy,
        1e3 * seconds / steps as f64
    );
}

fn conserved(name: &str, fidelity: Fidelity, steps: Option<usize>) -> Result<()> {
    let scene = scene(name)?;
    let steps = steps.unwrap_or(scene.steps);
    for (integrator, label) in INTEGRATORS {
        let simulator = simulator(
            &scene,
            Settings::default()
                .fidelity(fidelity)
                .integrator(integrator),
        )?;
        let start = Instant::now();
        let rollout = match simulator.rollout(&Controls::zeros(&simulator, steps)) {
            Ok(rollout) => rollout,
            Err(e) => {
                println!("| {} | {steps} | {label} | fails: {e} | | |", scene.name);
                continue;
            }
        };
        let seconds = start.elapsed().as_secs_f64();
        let drift = rollout.summary().momentum_drift;
        row(
            &scene.name,
            steps,
            label,
            energy_error(&rollout),
            Some(drift),
            seconds,
        );
    }
    Ok(())
}

/// Scenes that are pushed or dragged: against midpoint with a smaller step.
fn forced(name: &str, scene: &Scene, ratio: usize) -> Result<()> {
    let fine = Settings::default()
        .integrator(Integrator::Midpoint)
        .time_step(scene.time_step / ratio as f64);
    let fine = simulator(scene, fine)?;
    let converged = fine.rollout(&Controls::zeros(&fine, ratio * scene.steps))?;
    for (integrator, label) in INTEGRATORS {
        let simulator = simulator(scene, Settings::default().integrator(integrator))?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, scene.steps))?;
        let seconds = start.elapsed().as_secs_f64();
        let energy = energy_difference(&rollout, &converged, ratio);
        row(name, scene.steps, label, energy, None, seconds);
    }
    Ok(())
}

/// Observed order on the coins: errors of q and v after 0.16 s.
fn orders() -> Result<()> {
    let scene = scene("coins")?;
    let end = |integrator, steps: usize| {
        let settings = Settings::default()
            .integrator(integrator)
            .tolerance(1e-13)
            .time_step(0.16 / steps as f64);
        let simulator = simulator(&scene, settings.faces(80))?;
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
    println!("| scene | steps | integrator | energy error | momentum drift | ms a step |");
    println!("|---|---|---|---|---|---|");
    conserved("coins", Fidelity::Full, None)?;
    conserved("two_spheres", Fidelity::Full, None)?;
    conserved("cube", Fidelity::Full, None)?;
    conserved("kirchhoff_ellipsoid", Fidelity::Full, None)?;
    conserved("kirchhoff_ellipsoid", Fidelity::Isolated, Some(10_000))?;
    let ball = scene("falling_ball")?;
    // Before the lock: a stop within one step takes whatever energy is there at that step.
    let mut pushed = ball.clone();
    pushed.steps = 150;
    forced("falling ball, before the stop", &pushed, 4)?;
    orders()
}
