//! What the benches share: scenes and configurations by name, and a measurement in a process of its own,
//! so that its peak memory is its own.

pub mod reference;
#[path = "../../tests/support/mod.rs"]
pub mod support;

use hydrograd::coupling::reduced::cache;
use hydrograd::scene::{Preset, Scene};
use hydrograd::simulate::Method;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// One configuration of one scene, measured.
#[derive(Serialize, Deserialize)]
pub struct Run {
    /// Fidelity in use: what was asked for, or what `auto` chose.
    pub fidelity: String,
    pub faces: usize,
    pub unknowns: usize,
    /// s
    pub setup: f64,
    /// Forward step, s.
    pub forward: f64,
    /// Step of a rollout with its gradient, forward pass included, s.
    pub gradient: f64,
    /// Peak resident memory of the process, MB.
    pub memory: f64,
    /// Fluid part of the mass matrix at the start, generalised coordinates, column by column.
    pub added_mass: Vec<f64>,
}

/// How often a child measures.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Steps of a rollout.
    pub steps: usize,
    /// Rollouts that count; one more goes before them.
    pub repeat: usize,
}

/// The arguments after the name of the program, without those that Cargo adds.
pub fn arguments() -> Vec<String> {
    let all = std::env::args().skip(1);
    all.filter(|a| a != "--bench").collect()
}

/// An example scene; None, with a line that says so, if there is no such file.
pub fn scene(name: &str) -> Option<Scene> {
    let file = support::example_path(name);
    if !file.exists() {
        println!("(skipped: no examples/scenes/{name}.toml)");
        return None;
    }
    Some(Scene::load(file).expect("an example scene"))
}

/// Settings by the name of a configuration: a fidelity, `full mfs-vertex`, or `paper`.
pub fn settings(configuration: &str) -> Settings {
    let fidelity = match configuration {
        "paper" => return Settings::preset(Preset::Paper),
        "full" => Fidelity::Full,
        "full mfs-vertex" => return settings("full").method(Method::MfsVertex),
        "reduced" => Fidelity::Reduced,
        "auto" => Fidelity::Auto,
        other => panic!("{other}: no configuration"),
    };
    Settings::default().fidelity(fidelity)
}

/// Middle of the measured times.
pub fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

/// Peak resident memory of this process, MB; 0 where the system doesn't tell.
pub fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM"));
    let kb = line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1000.0
}

/// What a step takes.
pub struct StepTimes {
    /// Forward, s.
    pub forward: f64,
    /// Of a rollout with its gradient, forward pass included, s.
    pub gradient: f64,
    /// Most iterations of a solve.
    pub iterations: usize,
}

pub fn step_times(simulator: &Simulator, effort: Effort) -> hydrograd::Result<StepTimes> {
    let controls = Controls::zeros(simulator, effort.steps);
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (mut forward, mut whole, mut iterations) = (vec![], vec![], 0);
    for i in 0..=effort.repeat {
        let start = Instant::now();
        let rollout = simulator.rollout(&controls)?;
        let middle = start.elapsed().as_secs_f64();
        rollout.gradient(&goal)?;
        if i > 0 {
            forward.push(middle / effort.steps as f64);
            whole.push(start.elapsed().as_secs_f64() / effort.steps as f64);
        }
        iterations = rollout.summary().iterations;
    }
    Ok(StepTimes {
        forward: median(forward),
        gradient: median(whole),
        iterations,
    })
}

/// Fluid part of the mass matrix at the start: generalised coordinates, driven joints included.
pub fn added_mass(simulator: &Simulator) -> hydrograd::Result<DMatrix<f64>> {
    let mut q = simulator.start().0.clone();
    simulator.stepper().place_motions(&mut q, 0.0);
    let system = simulator.system();
    let mut dry = simulator.parameters().clone();
    *dry.density_mut() = 0.0;
    let submerged = system.evaluate(simulator.parameters(), &q, 0.0)?;
    let dry = system.evaluate(&dry, &q, 0.0)?;
    Ok(submerged.mass_matrix() - dry.mass_matrix())
}

fn measure(
    scene: &Scene,
    settings: Settings,
    effort: Effort,
    folder: Option<&Path>,
) -> hydrograd::Result<Run> {
    let start = Instant::now();
    let simulator = match folder {
        Some(folder) => Simulator::cached(scene, settings, folder)?,
        None => Simulator::new(scene, settings)?,
    };
    let setup = start.elapsed().as_secs_f64();
    let times = step_times(&simulator, effort)?;
    Ok(Run {
        fidelity: format!("{:?}", simulator.fidelity()).to_lowercase(),
        faces: simulator.faces(),
        unknowns: simulator.unknowns(),
        setup,
        forward: times.forward,
        gradient: times.gradient,
        memory: peak_memory(),
        added_mass: added_mass(&simulator)?.as_slice().to_vec(),
    })
}

/// Measures in a child process; the error is what the child says. With a `folder`, compressed bodies are
/// looked up there and left there.
pub fn in_child(
    scene: &str,
    configuration: &str,
    effort: Effort,
    folder: Option<&Path>,
) -> Result<Run, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut command = Command::new(program);
    command.args(["--child", scene, configuration]);
    command.args([effort.steps, effort.repeat].map(|n| n.to_string()));
    command.args(folder);
    let output = command.output().map_err(|e| e.to_string())?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let told = text.trim().replace('\n', " ");
        return Err(if told.is_empty() {
            format!("ended with {}", output.status)
        } else {
            told
        });
    }
    serde_json::from_str(&text).map_err(|e| format!("{e}: {text}"))
}

/// In a child process: measures, prints and returns true. Otherwise false.
pub fn serve_child() -> bool {
    let arguments = arguments();
    if arguments.first().is_none_or(|a| a != "--child") {
        return false;
    }
    let number = |i: usize| arguments[i].parse().expect("a number");
    let effort = Effort {
        steps: number(3),
        repeat: number(4),
    };
    let folder = arguments.get(5).map(Path::new);
    cache::forget();
    let scene = scene(&arguments[1]).expect("a scene");
    match measure(&scene, settings(&arguments[2]), effort, folder) {
        Ok(run) => println!("{}", serde_json::to_string(&run).expect("plain numbers")),
        Err(e) => {
            println!("{e}");
            std::process::exit(1);
        }
    }
    true
}
