//! A step of the simulation and its gradient at the paper's sizes: time, ratio, memory.
//!
//! `cargo bench --bench step [-- SCENE] [--quick]`. Prints one row per scene and configuration: seconds per forward step (all
//! derivatives that a step needs included), gradient of the rollout as a ratio to its forward pass, peak
//! memory of the process so far, and iterations; `full` by panels, as it is by default, and by fundamental solutions; of these the other integrators, a looser
//! tolerance, a dense QR and Jacobi preconditioning; the paper's choices, and `isolated`.

#[allow(dead_code)]
mod common;

use common::support::example;
use common::{Effort, arguments, peak_memory, step_times};
use hydrograd::coupling::full::{FullSolver, Preconditioner};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Preset, Scene};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator};
use std::time::Instant;

struct Row {
    scene: String,
    configuration: String,
    faces: usize,
    unknowns: usize,
    setup: f64,
    forward: f64,
    ratio: f64,
    iterations: usize,
    memory: f64,
}

fn measure(
    scene: &Scene,
    name: &str,
    settings: Settings,
    steps: usize,
    repeat: usize,
) -> hydrograd::Result<Row> {
    let start = Instant::now();
    let simulator = Simulator::new(scene, settings)?;
    let setup = start.elapsed().as_secs_f64();
    let times = step_times(&simulator, Effort { steps, repeat })?;
    Ok(Row {
        scene: scene.name.clone(),
        configuration: name.into(),
        faces: simulator.faces(),
        unknowns: simulator.unknowns(),
        setup,
        forward: times.forward,
        ratio: times.gradient / times.forward,
        iterations: times.iterations,
        memory: peak_memory(),
    })
}

fn main() {
    let arguments = arguments();
    let chosen: Vec<&String> = arguments.iter().filter(|a| !a.starts_with("--")).collect();
    println!(
        "| scene | configuration | faces | unknowns | setup s | forward s/step | gradient/forward | iterations | peak MB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in ["falling_ball_box", "falling_ball", "coins"] {
        if !chosen.is_empty() && !chosen.iter().any(|c| *c == name) {
            continue;
        }
        let scene = example(name);
        let full = Settings::default().fidelity(Fidelity::Full);
        let full = full.integrator(Integrator::Rk2);
        let base = full.method(Method::MfsVertex);
        let with = |solver, preconditioner| base.solver(solver).preconditioner(preconditioner);
        let jacobi = Settings {
            max_iterations: Some(5_000),
            ..with(FullSolver::Cgls, Preconditioner::Jacobi)
        };
        let one_evaluation = |s: &Settings| s.integrator(Integrator::MomentumEuler);
        let rows = [
            ("full", full.clone(), 5, 5),
            ("full, mfs-vertex", base.clone(), 5, 5),
            ("momentum Euler", one_evaluation(&base), 5, 5),
            (
                "momentum Euler, tolerance 1e-6",
                one_evaluation(&base.tolerance(1e-6)),
                5,
                5,
            ),
            ("midpoint", base.integrator(Integrator::Midpoint), 2, 1),
            ("RK4", base.integrator(Integrator::Rk4), 2, 1),
            ("preset paper", Settings::preset(Preset::Paper), 2, 1),
            (
                "momentum Euler, dense QR",
                one_evaluation(&with(FullSolver::Qr, Preconditioner::None)),
                1,
                1,
            ),
            ("momentum Euler, Jacobi", one_evaluation(&jacobi), 1, 1),
            (
                "isolated",
                full.fidelity(Fidelity::Isolated).method(Method::Auto),
                200,
                5,
            ),
        ];
        for (configuration, settings, steps, repeat) in rows {
            let quick = arguments.iter().any(|a| a == "--quick");
            if quick && !configuration.starts_with("full") {
                continue;
            }
            let r = match measure(&scene, configuration, settings, steps, repeat) {
                Ok(r) => r,
                Err(e) => {
                    println!("| {} | {configuration} | {e} |||||||", scene.name);
                    continue;
                }
            };
            println!(
                "| {} | {} | {} | {} | {:.3} | {:.2e} | {:.2} | {} | {:.0} |",
                r.scene,
                r.configuration,
                r.faces,
                r.unknowns,
                r.setup,
                r.forward,
                r.ratio,
                r.iterations,
                r.memory
            );
        }
    }
}
