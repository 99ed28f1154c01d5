//! `hydrograd run`: a scene's trajectory.

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use super::input;
use super::options::{Time, Water};
use super::output::{Output, or_dash, write_warnings};
use super::progress::Progress;
use super::trajectory::{self, Trajectory};
use crate::scene::Scene;
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The scene file.
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    #[command(flatten)]
    water: Water,
    #[command(flatten)]
    time: Time,
    /// Folder for trajectory.csv and trajectory.json: time, q, v, energy, momentum, smallest gap
    /// [default: none are written].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Summary of a run. SI units.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub scene: String,
    pub fidelity: String,
    pub method: String,
    pub integrator: String,
    pub bodies: usize,
    pub faces: usize,
    pub unknowns: usize,
    pub steps: usize,
    pub dt: f64,
    /// Wall time of the whole run, setup included, s.
    pub seconds: f64,
    /// Wall time of what is made once per shape, s.
    pub setup_seconds: f64,
    /// Wall time of a step, setup left out, s.
    pub seconds_per_step: f64,
    /// Largest memory held, 10⁶ bytes; null where the system doesn't tell.
    pub peak_memory_mb: Option<f64>,
    pub energy_initial: f64,
    pub energy_final: f64,
    /// Largest departure of the total momentum from its start, relative to the largest momentum of
    /// a single body; linear and angular, the larger of both.
    pub momentum_drift: f64,
    /// Smallest gap of the whole run, m; null where there is nothing to meet.
    pub min_gap: Option<f64>,
    pub final_q: Vec<f64>,
    pub final_v: Vec<f64>,
    pub warnings: Vec<String>,
    /// What was written.
    pub files: Vec<PathBuf>,
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<ExitCode> {
    let scene = input::scene(&arguments.scene, &arguments.water, &arguments.time)?;
    if let Some(folder) = &arguments.out {
        trajectory::prepare(folder)?;
    }
    let progress = Progress::new("steps", scene.steps);
    let (mut report, trajectory) = simulate(&scene, arguments, &progress)?;
    drop(progress);
    if let Some(folder) = &arguments.out {
        report.files = trajectory.write(folder)?.into();
    }
    output.result(&report);
    Ok(ExitCode::SUCCESS)
}

/// TO FILL IN: build the simulator with the settings of `arguments.water` and `arguments.time`,
/// run `scene.steps` steps (`progress.set(done)` after each), and gather report and trajectory.
fn simulate(
    _scene: &Scene,
    _arguments: &Arguments,
    _progress: &Progress,
) -> Result<(Report, Trajectory)> {
    Err(Error::Unsupported {
        what: "run".into(),
        why: "the simulator isn't connected to the command line".into(),
        instead: "use the Rust interface".into(),
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} steps of {} s, {} ({}, {})",
            self.scene, self.steps, self.dt, self.fidelity, self.method, self.integrator
        )?;
        writeln!(
            f,
            "  {} bodies, {} faces, {} unknowns",
            self.bodies, self.faces, self.unknowns
        )?;
        writeln!(
            f,
            "  time    {:.3} s: setup {:.3} s, a step {:.3e} s; peak memory {}",
            self.seconds,
            self.setup_seconds,
            self.seconds_per_step,
            or_dash(self.peak_memory_mb, "MB")
        )?;
        writeln!(
            f,
            "  energy  {:.6e} J at the start, {:.6e} J at the end",
            self.energy_initial, self.energy_final
        )?;
        writeln!(f, "  momentum drift {:.2e}", self.momentum_drift)?;
        writeln!(f, "  smallest gap   {}", or_dash(self.min_gap, "m"))?;
        writeln!(f, "  final q {:?}", self.final_q)?;
        write!(f, "  final v {:?}", self.final_v)?;
        for file in &self.files {
            write!(f, "\n  wrote   {}", file.display())?;
        }
        write_warnings(f, &self.warnings)
    }
}
