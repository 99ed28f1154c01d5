//! A step of the simulation and its gradient at the paper's sizes: time, ratio, memory.
//!
//! `cargo bench --bench step [-- SCENE] [--quick]`. Prints one row per scene and configuration: seconds per forward step (all
//! derivatives that a step needs included), gradient of the rollout as a ratio to its forward pass, peak
//! memory of the process so far, and iterations; `full` by panels, as it is by default, and by fundamental solutions; of these the other integrators, a looser
//! tolerance, a dense QR and Jacobi preconditioning; the paper's choices, and `isolated`.
//!
//! `cargo bench --bench step -- forward [SCENE]`: linearisations and forward mode against steps, all in one run.

#[allow(dead_code)]
mod common;

use common::support::example;
use common::{Effort, arguments, peak_memory, step_times};
use hydrograd::coupling::full::{FullSolver, Preconditioner};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, BodyId, Drag, Fluid, Joint, Preset, Scene, Shape};
use hydrograd::simulate::{Method, Variables};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DVector;
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

/// A single body with its own added mass, thrusters and both drags.
fn vehicle() -> (Scene, Settings) {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.name = "vehicle".into();
    let drag = Drag {
        linear: 5.0,
        quadratic: 0.3,
        ..Drag::default()
    };
    let hull = Shape::ellipsoid([0.6, 0.15, 0.15]).faces(1280);
    scene.add(Body::new(hull).density(1005.0).thruster().drag(drag));
    scene.initial.v = vec![0.5, 0.1, 0.0, 0.05, 0.1, 0.2];
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    (scene, settings)
}

fn falling_ball() -> (Scene, Settings) {
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    (example("falling_ball"), settings)
}

/// Ten actuated links in a row, one after the other.
fn chain() -> (Scene, Settings) {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.name = "chain".into();
    let axis = [0.0, 0.0, 1.0];
    for k in 0..10 {
        let link = Body::new(Shape::ellipsoid([0.1, 0.03, 0.04]).faces(320)).density(1005.0);
        let link = link.named(format!("link {k}")).actuated();
        let link = link.drag(Drag {
            linear: 5.0,
            ..Drag::default()
        });
        scene.add(match k {
            0 => link.joint(Joint::Revolute { axis }),
            _ => {
                let last = format!("link {}", k - 1);
                let link = link.child_of(last).at([0.22, 0.0, 0.0]);
                link.joint(Joint::Revolute { axis })
            }
        });
    }
    scene.initial.v = (0..10).map(|k| 0.3 * (1.3 * f64::from(k)).sin()).collect();
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    (scene, settings)
}

/// Seconds of the fastest of some calls.
fn fastest(
    repeat: usize,
    mut call: impl FnMut() -> hydrograd::Result<()>,
) -> hydrograd::Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..repeat {
        let start = Instant::now();
        call()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}

/// Steps of a rollout all of whose steps are linearised.
const BRIEF: usize = 20;

/// Linearisations of single steps, and of all steps of a rollout, against steps; a Jacobian of all positions by seven parameters against the forward run and sweeps.
fn forward(scene: &Scene, settings: Settings) -> hydrograd::Result<()> {
    let steps = 300;
    let simulator = Simulator::new(scene, settings)?;
    let none = Controls::zeros(&simulator, steps);
    let start = simulator.initial()?;
    let nu = simulator.system().controls;
    let nv = simulator.system().tree.velocities();
    let one = DVector::zeros(nu);
    let step = fastest(200, || simulator.step(&start, &one).map(drop))?;
    let record = simulator.step(&start, &one)?.1;
    let jacobians = fastest(200, || record.jacobians().map(drop))?;
    // Short ones, often: other work on the machine disturbs fewer of them.
    let brief = Controls::zeros(&simulator, BRIEF);
    let run = fastest(100, || simulator.rollout(&brief).map(drop))?;
    let rollout = simulator.rollout(&brief)?;
    let all = fastest(100, || rollout.step_jacobians(&[]).map(drop))?;
    let whole = fastest(10, || simulator.rollout(&none).map(drop))?;
    let rollout = simulator.rollout(&none)?;
    let names: Vec<String> = simulator
        .parameters()
        .names()
        .map(String::from)
        .take(7)
        .collect();
    let variables = Variables {
        parameters: names,
        ..Variables::default()
    };
    let states: Vec<usize> = (1..=steps).collect();
    let by_parameters = fastest(10, || {
        rollout
            .jacobian(&variables, &["positions"], &states)
            .map(drop)
    })?;
    let goal = objective::final_position(BodyId(0), [0.0; 3]);
    let sweep = fastest(3, || rollout.gradient(&goal).map(drop))?;
    let rows = 3 * steps * simulator.system().len();
    println!(
        "| {} | {nv} | {nu} | {:.1} | {:.2} | {} | {:.2} | {:.2} | {rows} × 7 | {:.2} | {:.0} |",
        scene.name,
        1e6 * step,
        jacobians / step,
        2 * nv + nu,
        1e6 * run / BRIEF as f64,
        all / run,
        by_parameters / whole,
        rows as f64 * sweep / by_parameters,
    );
    Ok(())
}

fn forward_table(chosen: &[String]) {
    println!(
        "| scene | velocities | controls | step µs | Jacobians of a step / step | steps of one-sided differences | step of a rollout µs | \
         all steps' Jacobians / rollout | Jacobian by parameters | that / rollout | its reverse sweeps / that |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (scene, settings) in [vehicle(), falling_ball(), chain()] {
        if chosen.len() > 1 && !chosen.contains(&scene.name) {
            continue;
        }
        if let Err(e) = forward(&scene, settings) {
            println!("| {} | {e} |||||||||", scene.name);
        }
    }
}

fn main() {
    let arguments = arguments();
    if arguments.iter().any(|a| a == "forward") {
        return forward_table(&arguments);
    }
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
