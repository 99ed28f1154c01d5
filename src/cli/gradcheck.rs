//! `hydrograd gradcheck`: the reverse sweep against finite differences.

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use super::input;
use super::options::{Time, Water, positive};
use super::output::{Output, write_warnings};
use super::progress::Progress;
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
    /// Random directions for each of controls, initial state and parameters.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = positive)]
    directions: usize,
    /// Seed of the random directions.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
}

/// How well gradient and finite differences agree, and what the gradient costs.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub scene: String,
    pub fidelity: String,
    pub method: String,
    pub integrator: String,
    pub steps: usize,
    /// Steps of the central differences; the errors below are the least over them.
    pub step_sizes: Vec<f64>,
    /// The largest of the three below.
    pub max_rel_error: f64,
    /// Null where the scene has no controls.
    pub rel_error_controls: Option<f64>,
    pub rel_error_initial: f64,
    pub rel_error_parameters: f64,
    /// Median wall time of a trajectory, s.
    pub forward_seconds: f64,
    /// Median wall time of a trajectory and its gradient, s.
    pub gradient_seconds: f64,
    /// `gradient_seconds / forward_seconds`.
    pub ratio: f64,
    pub warnings: Vec<String>,
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<ExitCode> {
    let scene = input::scene(&arguments.scene, &arguments.water, &arguments.time)?;
    let progress = Progress::new("directions", 3 * arguments.directions);
    let report = check(&scene, arguments, &progress)?;
    drop(progress);
    output.result(&report);
    Ok(ExitCode::SUCCESS)
}

/// TO FILL IN: adjoint against central differences along `arguments.directions` random directions
/// (`arguments.seed`) in controls, initial state and parameters, at several step sizes; times as
/// medians of at least 5 after a warm-up. `progress.set(done)` after each direction.
fn check(_scene: &Scene, _arguments: &Arguments, _progress: &Progress) -> Result<Report> {
    Err(Error::Unsupported {
        what: "gradcheck".into(),
        why: "the simulator isn't connected to the command line".into(),
        instead: "use the Rust interface".into(),
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} steps, {} ({}, {}); relative error of the gradient against central differences",
            self.scene, self.steps, self.fidelity, self.method, self.integrator
        )?;
        match self.rel_error_controls {
            Some(error) => writeln!(f, "  controls      {error:.2e}")?,
            None => writeln!(f, "  controls      none in this scene")?,
        }
        writeln!(f, "  initial state {:.2e}", self.rel_error_initial)?;
        writeln!(f, "  parameters    {:.2e}", self.rel_error_parameters)?;
        write!(
            f,
            "  trajectory {:.4} s, with its gradient {:.4} s: {:.2} times",
            self.forward_seconds, self.gradient_seconds, self.ratio
        )?;
        write_warnings(f, &self.warnings)
    }
}
