//! A step of the simulation and its gradient at the paper's sizes: time, ratio, memory.
//!
//! `cargo bench --bench step [-- SCENE] [--quick]`. Prints one row per scene and configuration: seconds per forward step (all
//! derivatives that a step needs included), gradient of the rollout as a ratio to its forward pass, peak
//! memory of the process so far, and iterations; beside the default the other integrators, a looser tolerance, the
//! paper's choices, a dense QR, Jacobi preconditioning and `isolated`.

use hydrograd::coupling::full::{Preconditioner, Solver};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Preset, Scene};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use std::path::Path;
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

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

/// Peak resident memory of the process, MB; 0 where the system doesn't tell.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM"));
    let kb = line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1000.0
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
    let controls = Controls::zeros(&simulator, steps);
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (mut forward, mut whole, mut iterations) = (vec![], vec![], 0);
    for i in 0..=repeat {
        let start = Instant::now();
        let rollout = simulator.rollout(&controls)?;
        let middle = start.elapsed().as_secs_f64();
        rollout.gradient(&goal)?;
        if i > 0 {
            forward.push(middle / steps as f64);
            whole.push(start.elapsed().as_secs_f64() / steps as f64);
        }
        iterations = rollout.summary().iterations;
    }
    let forward = median(forward);
    Ok(Row {
        scene: scene.name.clone(),
        configuration: name.into(),
        faces: simulator.faces(),
        unknowns: simulator.unknowns(),
        setup,
        forward,
        ratio: median(whole) / forward,
        iterations,
        memory: peak_memory(),
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let chosen: Vec<&String> = arguments.iter().filter(|a| !a.starts_with("--")).collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    println!(
        "| scene | configuration | faces | unknowns | setup s | forward s/step | gradient/forward | iterations | peak MB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in ["falling_ball_box", "falling_ball", "coins"] {
        if !chosen.is_empty() && !chosen.iter().any(|c| *c == name) {
            continue;
        }
        let scene = Scene::load(folder.join(format!("{name}.toml"))).expect("an example scene");
        let base = Settings::for_scene(&scene);
        let with = |solver, preconditioner| {
            let mut s = base;
            s.solve.solver = solver;
            s.solve.preconditioner = preconditioner;
            s
        };
        let mut jacobi = with(Solver::Cgls, Preconditioner::Jacobi);
        jacobi.solve.max_iterations = 5_000;
        let one_evaluation = |s: Settings| s.integrator(Integrator::MomentumEuler);
        let rows = [
            ("default", base, 5, 5),
            ("momentum Euler", one_evaluation(base), 5, 5),
            (
                "momentum Euler, tolerance 1e-6",
                one_evaluation(base.tolerance(1e-6)),
                5,
                5,
            ),
            ("midpoint", base.integrator(Integrator::Midpoint), 2, 1),
            ("RK4", base.integrator(Integrator::Rk4), 2, 1),
            ("preset paper", Settings::preset(Preset::Paper), 2, 1),
            (
                "momentum Euler, dense QR",
                one_evaluation(with(Solver::Qr, Preconditioner::None)),
                1,
                1,
            ),
            ("momentum Euler, Jacobi", one_evaluation(jacobi), 1, 1),
            ("isolated", base.fidelity(Fidelity::Isolated), 200, 5),
        ];
        for (configuration, settings, steps, repeat) in rows {
            let quick = arguments.iter().any(|a| a == "--quick");
            if quick && configuration != "default" {
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
