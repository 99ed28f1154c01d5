//! What the benches share: scenes and configurations by name, and a measurement in a process of its own,
//! so that its peak memory is its own.

mod measure;
pub mod reference;
#[path = "../../tests/support/mod.rs"]
pub mod support;

use hydrograd::coupling::reduced::cache;
use hydrograd::scene::{Preset, Scene};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator};
pub use measure::*;
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
