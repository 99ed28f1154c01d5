//! `hydrograd gradcheck`: the reverse sweep against finite differences.

use std::fmt;

use clap::Args;
use serde::Serialize;

use super::exit::Exit;
use super::options::{Simulation, positive};
use super::output::{ChoicesReport, Output, progress_bar, set_progress, write_warnings};
use crate::Result;
use crate::scene::Scene;
use crate::simulate::gradcheck::{self, gradcheck_with};
use crate::simulate::growth::{Growth, growth};

/// Largest relative error that passes.
const LIMIT: f64 = 1e-6;
/// Tolerance of the coupled solve in the check, unless one is given: differences show its errors.
const TOLERANCE: f64 = 1e-12;
/// Repetitions of which the times are medians.
const TIMINGS: usize = 5;

#[derive(Debug, Args)]
#[command(
    after_help = "Each direction's error is the least over the step sizes. The check solves to \
                  1e-12 unless --tolerance is given; the times are taken at 1e-8 or what is given. \
                  Exit code 1 if an error is above 1e-6."
)]
pub(super) struct Arguments {
    #[command(flatten)]
    simulation: Simulation,
    /// Random directions for each of controls, initial state and parameters.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = positive)]
    directions: usize,
    /// Seed of the random directions.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Leaves out how much the trajectory magnifies small changes: for many bodies that takes longest.
    #[arg(long)]
    no_growth: bool,
}

/// How well gradient and finite differences agree, and what the gradient costs.
#[derive(Clone, Debug, Serialize)]
pub(super) struct CheckReport {
    pub scene: String,
    #[serde(flatten)]
    pub choices: ChoicesReport,
    pub steps: usize,
    /// Whether `max_rel_error` is at most [`LIMIT`].
    pub ok: bool,
    /// Tolerance of the coupled solve in the check; the times are taken at the usual one.
    pub tolerance: f64,
    /// Steps of the central differences; the errors below are the least over them.
    pub step_sizes: Vec<f64>,
    /// The largest of the three below: relative error of the worst direction at its best step.
    pub max_rel_error: f64,
    /// Null where the scene has no controls.
    pub rel_error_controls: Option<f64>,
    /// Null where nothing can move.
    pub rel_error_initial: Option<f64>,
    /// Physical parameters and gains of the controller.
    pub rel_error_parameters: Option<f64>,
    /// Median wall time of a trajectory, s.
    pub forward_seconds: f64,
    /// Median wall time of a trajectory and its gradient, s.
    pub gradient_seconds: f64,
    /// `gradient_seconds / forward_seconds`.
    pub ratio: f64,
    /// How much the trajectory magnifies small changes of its state; null with `--no-growth`.
    pub growth: Option<Growth>,
    /// What to do about it, where it is large.
    pub advice: Option<String>,
    pub warnings: Vec<String>,
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    let scene = arguments.simulation.scene()?;
    let progress = progress_bar("directions", 3 * arguments.directions);
    let done = |done, all| set_progress(&progress, done, all);
    let report = check(&scene, arguments, done)?;
    drop(progress);
    output.result(&report);
    if report.ok {
        return Ok(Exit::Done);
    }
    output.error_for_people(&format_args!(
        "the gradient isn't that of differences: relative error {:.2e}, the limit is {LIMIT:.0e}",
        report.max_rel_error
    ));
    Ok(Exit::Failed)
}

/// The check at a tight tolerance, then the times at the usual one.
fn check(
    scene: &Scene,
    arguments: &Arguments,
    done: impl FnMut(usize, usize),
) -> Result<CheckReport> {
    let Simulation { water, .. } = &arguments.simulation;
    let usual = arguments.simulation.settings();
    let tight = match water.tolerance {
        Some(_) => usual.clone(),
        None => usual.tolerance(TOLERANCE),
    };
    let steps = scene.steps;
    let mut simulator = water.simulator(scene, tight)?;
    let found = gradcheck_with(
        &mut simulator,
        &gradcheck::GradcheckSettings {
            steps,
            directions: arguments.directions,
            seed: arguments.seed,
            timings: 0,
            enough: None,
        },
        done,
    )?;
    let growth = (!arguments.no_growth).then(|| growth(&simulator, steps));
    let growth = growth.transpose()?;
    let choices = ChoicesReport::new(&simulator);
    let tolerance = simulator.choices().water.numerics.solve.tolerance;
    drop(simulator);
    let simulator = water.simulator(scene, usual)?;
    // The tight tolerance isn't the user's, and so not to be warned of where the fidelity takes none.
    let warnings = simulator.warnings().to_vec();
    let times = gradcheck::timings(&simulator, steps, TIMINGS)?;
    Ok(CheckReport {
        scene: scene.name.clone(),
        choices,
        steps,
        ok: found.max_rel_error <= LIMIT,
        tolerance,
        step_sizes: found.step_sizes,
        max_rel_error: found.max_rel_error,
        rel_error_controls: found.rel_error_controls,
        rel_error_initial: found.rel_error_initial,
        rel_error_parameters: found.rel_error_parameters,
        forward_seconds: times.forward,
        gradient_seconds: times.gradient,
        ratio: times.ratio(),
        advice: growth.as_ref().and_then(Growth::advice),
        growth,
        warnings,
    })
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let choices = &self.choices;
        writeln!(
            f,
            "{}: {} steps, {} ({}, {}); relative error of the gradient against central differences",
            self.scene, self.steps, choices.fidelity, choices.method, choices.integrator
        )?;
        let mut line = |what: &str, error: Option<f64>, none: &str| match error {
            Some(error) => writeln!(f, "  {what:<13} {error:.2e}"),
            None => writeln!(f, "  {what}{none}"),
        };
        let immovable = " can't be varied in this scene";
        line(
            "controls",
            self.rel_error_controls,
            "      none in this scene",
        )?;
        line("initial state", self.rel_error_initial, immovable)?;
        line(
            "parameters",
            self.rel_error_parameters,
            "    none in this scene",
        )?;
        writeln!(
            f,
            "  {}: the largest is {:.2e}, the limit {LIMIT:.0e}; solved to {:.0e}",
            if self.ok { "pass" } else { "FAIL" },
            self.max_rel_error,
            self.tolerance
        )?;
        write!(
            f,
            "  trajectory {:.4} s, with its gradient {:.4} s: {:.2} times",
            self.forward_seconds, self.gradient_seconds, self.ratio
        )?;
        write!(f, "\n  backend {}", choices.backend)?;
        if let Some(growth) = &self.growth {
            let (step, peak) = (&growth.largest_step, &growth.peak);
            write!(
                f,
                "\n  a change of the state grows by at most {:.3e} over {} s ({:.3e} by t = {} s), in one step by {:.3e} (step {}, t = {} s)",
                growth.total,
                growth.duration,
                peak.factor,
                peak.time,
                step.factor,
                step.step,
                step.time
            )?;
        }
        if let Some(advice) = &self.advice {
            write!(f, "\n  {advice}")?;
        }
        write_warnings(f, &self.warnings)
    }
}
