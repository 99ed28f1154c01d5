//! Table 1: what a step of each of the paper's scenes costs, with the paper's own choices and with ours. Each is measured in a process of its own, so that its peak memory is its own.
//!
//! One frame is one step of the paper's integrator, semi-implicit Euler, which evaluates the water once: *forward* are the solves for M_f; *others* is a step of the same bodies without
//! coupling; *backward* is what is left of a step, which is mostly ∂M_f/∂q. Ours beside that: a step of the default integrator, RK4, which evaluates four times, and one with its share of the
//! gradient of the whole run.

#[allow(dead_code)]
#[path = "../../benches/common/measure.rs"]
mod measure;

use crate::bars::{Bars, draw};
use crate::{How, Made, Numbers};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::Preset;
use hydrograd::{Body, Fidelity, Joint, Scene, Settings, Simulator};
use measure::{Effort, median, peak_memory, step_times};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::error::Error;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// A row of the paper's table.
struct Row {
    file: &'static str,
    label: &'static str,
    published: Published,
}

/// On an RTX 3060 (single precision, PyTorch) with an i7-11800H.
#[derive(Serialize)]
struct Published {
    bodies: usize,
    dof: usize,
    faces: usize,
    megabytes: f64,
    forward_s: f64,
    backward_s: f64,
    others_s: f64,
    total_s: f64,
}

const fn published(counts: [usize; 3], megabytes: f64, times: [f64; 4]) -> Published {
    let [bodies, dof, faces] = counts;
    let [forward_s, backward_s, others_s, total_s] = times;
    Published {
        bodies,
        dof,
        faces,
        megabytes,
        forward_s,
        backward_s,
        others_s,
        total_s,
    }
}

const ROWS: [Row; 4] = [
    Row {
        file: "falling_ball_box",
        label: "falling ball",
        published: published([3, 5, 3582], 2088.0, [0.179, 0.131, 0.379e-3, 0.310]),
    },
    Row {
        file: "grasp_open",
        label: "grasping",
        published: published([4, 6, 3768], 2475.0, [0.187, 0.225, 0.546e-3, 0.413]),
    },
    Row {
        file: "fish_near_tail",
        label: "fish near tail",
        published: published([4, 6, 5144], 3821.0, [0.382, 0.436, 0.587e-3, 0.819]),
    },
    Row {
        file: "clown_fish",
        label: "clown fish",
        published: published([4, 8, 4646], 3877.0, [0.395, 0.544, 0.700e-3, 0.940]),
    },
];

const CONFIGURATIONS: [&str; 4] = ["preset_paper", "full", "reduced", "auto"];
/// Faces of a body with coarse meshes.
const COARSE: usize = 200;
/// What the program is called with to measure one configuration.
const CHILD: &str = "--measure";

/// One configuration of one scene, measured.
#[derive(Serialize, Deserialize)]
struct Measured {
    /// What was asked for, or what `auto` chose.
    fidelity: String,
    bodies: usize,
    dof: usize,
    faces: usize,
    /// Peak resident memory of the process, what prepares the run included.
    megabytes: f64,
    /// What prepares the run.
    setup_s: f64,
    forward_s: f64,
    backward_s: f64,
    others_s: f64,
    total_s: f64,
    /// With its share of the gradient of the run, its forward pass included.
    with_gradient_s: f64,
    /// The two with the default integrator, where it isn't the paper's own preset.
    rk4_s: Option<[f64; 2]>,
}

pub fn make(how: &How) -> Made {
    let mut numbers = Numbers::new();
    let mut bars: Vec<Vec<f64>> = Vec::new();
    let rows = &ROWS[..if how.quick { 2 } else { ROWS.len() }];
    for row in rows {
        let mut of = Numbers::new();
        of.insert("paper".into(), serde_json::to_value(&row.published)?);
        let mut totals = vec![row.published.total_s];
        for configuration in CONFIGURATIONS {
            let found = match cfg!(test) {
                // The program is then that of the tests.
                true => measure(row.file, configuration, how.quick)?,
                false => in_child(row.file, configuration, how.quick)?,
            };
            totals.push(found.total_s);
            of.insert(configuration.into(), serde_json::to_value(found)?);
        }
        bars.push(totals);
        numbers.insert(row.file.into(), json!(of));
    }
    draw(
        how.picture,
        &Bars {
            title: "a step of semi-implicit Euler, s",
            groups: rows.iter().map(|r| r.label).collect(),
            names: vec!["paper (GPU)", "preset paper", "full", "reduced", "auto"],
            values: bars,
        },
    )?;
    Ok(numbers)
}

fn in_child(file: &str, configuration: &str, quick: bool) -> Result<Measured, Box<dyn Error>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args([CHILD, file, configuration]);
    command.args(quick.then_some("--quick"));
    let output = command.output()?;
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{file}, {configuration}: {}", told.trim()).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// In a child process: measures, prints and returns true.
pub fn serve(arguments: &[String]) -> Result<bool, Box<dyn Error>> {
    let [first, file, configuration, rest @ ..] = arguments else {
        return Ok(false);
    };
    if first != CHILD {
        return Ok(false);
    }
    let found = measure(file, configuration, !rest.is_empty())?;
    println!("{}", serde_json::to_string(&found)?);
    Ok(true)
}

fn settings(configuration: &str) -> Result<Settings, String> {
    let fidelity = match configuration {
        "preset_paper" => return Ok(Settings::preset(Preset::Paper)),
        "full" => Fidelity::Full,
        "reduced" => Fidelity::Reduced,
        "auto" => Fidelity::Auto,
        other => return Err(format!("{other}: no configuration")),
    };
    Ok(Settings::default().fidelity(fidelity))
}

fn measure(file: &str, configuration: &str, quick: bool) -> Result<Measured, Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    let mut scene = Scene::load(folder.join(format!("{file}.toml")))?;
    if quick {
        coarsen(&mut scene);
    }
    let settings = settings(configuration)?;
    let compressed = matches!(configuration, "reduced" | "auto");
    let (steps, repeats) = match (quick, compressed) {
        (true, _) => (1, 1),
        (false, true) => (20, 5),
        (false, false) => (2, 2),
    };
    let euler = settings.integrator(Integrator::VelocityEuler);
    let start = Instant::now();
    let simulator = Simulator::new(&scene, euler)?;
    let setup_s = start.elapsed().as_secs_f64();
    let forward_s = evaluation(&simulator, steps * repeats)?;
    let timed = |simulator: &Simulator, steps, repeat| {
        let times = step_times(simulator, Effort { steps, repeat })?;
        Ok::<_, hydrograd::Error>([times.forward, times.gradient])
    };
    let [total_s, with_gradient_s] = timed(&simulator, steps, repeats)?;
    let megabytes = peak_memory();
    let rk4_s = match settings.preset {
        Some(_) => None,
        None => {
            let rk4 = Simulator::new(&scene, settings.integrator(Integrator::Rk4))?;
            Some(timed(&rk4, steps, repeats.div_ceil(2))?)
        }
    };
    let alone = Settings::default().fidelity(Fidelity::Isolated);
    let alone = Simulator::new(&scene, alone.integrator(Integrator::VelocityEuler))?;
    let [others_s, _] = timed(&alone, 100, repeats)?;
    Ok(Measured {
        fidelity: format!("{:?}", simulator.fidelity()).to_lowercase(),
        bodies: simulator.system().len(),
        dof: simulator.system().tree.velocities(),
        faces: simulator.faces(),
        megabytes,
        setup_s,
        forward_s,
        backward_s: total_s - forward_s - others_s,
        others_s,
        total_s,
        with_gradient_s,
        rk4_s,
    })
}

/// Fewer faces of all that moves: the floor's are as large as the gap above it allows.
fn coarsen(scene: &mut Scene) {
    let moving = |b: &&mut Body| b.joint != Joint::Fixed;
    for body in scene.bodies.iter_mut().filter(moving) {
        if let Some(shape) = &mut body.shape {
            shape.set_faces(COARSE);
        }
    }
}

/// M_f at the start, s.
fn evaluation(simulator: &Simulator, repeats: usize) -> hydrograd::Result<f64> {
    let mut q = simulator.start().0.clone();
    simulator.stepper().place_motions(&mut q, 0.0);
    let once = || {
        let start = Instant::now();
        simulator
            .system()
            .evaluate(simulator.parameters(), &q, 0.0)?;
        Ok(start.elapsed().as_secs_f64())
    };
    once()?;
    (0..repeats)
        .map(|_| once())
        .collect::<hydrograd::Result<_>>()
        .map(median)
}
