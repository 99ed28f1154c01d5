//! `hydrograd tradeoff`: time per step against error, over everything that can be chosen.

mod plot;
mod table;

use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;

use super::exit::Exit;
use super::options::{RobotArguments, choice, load, positive, seconds, tolerance};
use super::output::{Output, progress_bar, set_progress};
use crate::Result;
use crate::dynamics::Integrator;
use crate::simulate::{Fidelity, Method};
use crate::tradeoff::{self, Tradeoff, TradeoffProgress, TradeoffSettings, TradeoffStage};
use table::TradeoffReport;

#[derive(Debug, Args)]
#[command(
    after_help = "Errors are relative: of the added mass against coupled panels on finer and finer \
                  meshes, of accelerations and end states against compressed bodies of high accuracy \
                  with a quarter of the time step. Each configuration is timed by itself, one after \
                  another. Of each list that is given, the first value is what all else is varied around."
)]
pub(super) struct Arguments {
    /// The scene file, or a robot, which is then alone in still fresh water.
    #[arg(value_name = "SCENE.toml|ROBOT.urdf")]
    scene: PathBuf,
    #[command(flatten)]
    robot: RobotArguments,
    /// Fidelities, with commas between [default: isolated,reduced,auto,full].
    #[arg(long, value_parser = choice::<Fidelity>(), value_delimiter = ',', value_name = "LIST")]
    fidelities: Vec<Fidelity>,
    /// Methods by which a body alone is solved [default: what the scene asks for, and the others
    /// that the fidelity has].
    #[arg(long, value_parser = choice::<Method>(), value_delimiter = ',', value_name = "LIST")]
    methods: Vec<Method>,
    /// Faces per body, for shapes by formula [default: the scene's own, and 80,320,1280].
    #[arg(long, value_parser = positive, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    faces_list: Vec<usize>,
    /// Points of each compressed body, with the fidelity reduced [default: 20,40,80,160,320].
    #[arg(long, value_parser = positive, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    ranks: Vec<usize>,
    /// Errors that reduced and auto aim at [default: their own, and 3e-2 to 1e-4].
    #[arg(long, value_parser = tolerance, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    accuracies: Vec<f64>,
    /// Relative residuals of the coupled solve, with the fidelity full [default: its own, and 1e-3
    /// to 1e-10].
    #[arg(long, value_parser = tolerance, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    tolerances: Vec<f64>,
    /// Integrators, with one fidelity: reduced if it is among them [default: the scene's own, and
    /// all others].
    #[arg(long, value_parser = choice::<Integrator>(), value_delimiter = ',', value_name = "LIST")]
    integrators: Vec<Integrator>,
    /// Time steps in s, with the same fidelity [default: the scene's own, and 4 times to a quarter of it].
    #[arg(long, value_parser = seconds, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    time_steps: Vec<f64>,
    /// Every combination of what is varied, in place of one after the other.
    #[arg(long)]
    full_product: bool,
    /// Steps of the scene's own length over which trajectories are compared [default: the scene's
    /// own number, at most 50].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    steps: Option<usize>,
    /// Finest faces per body of the reference, whatever time it takes [default: as many as the
    /// budget has time for].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    reference_faces: Option<usize>,
    /// Time in s to do all this in, roughly; what is left out for it is said.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value_t = 120.0, allow_negative_numbers = true)]
    budget: f64,
    /// Picture to write, an SVG [default: none is written].
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl Arguments {
    fn settings(&self) -> TradeoffSettings {
        TradeoffSettings {
            fidelities: self.fidelities.clone(),
            methods: self.methods.clone(),
            faces: self.faces_list.clone(),
            ranks: self.ranks.clone(),
            accuracies: self.accuracies.clone(),
            tolerances: self.tolerances.clone(),
            integrators: self.integrators.clone(),
            time_steps: self.time_steps.clone(),
            full_product: self.full_product,
            steps: self.steps,
            reference_faces: self.reference_faces,
            budget: Some(self.budget),
        }
    }
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    let scene = load(&arguments.scene, &arguments.robot, None)?;
    scene.validate()?;
    if let Some(file) = &arguments.plot {
        plot::prepare(file)?;
    }
    let mut bar = None;
    let found = tradeoff::measure(&scene, &arguments.settings(), |now: TradeoffProgress| {
        let what = match now.stage {
            TradeoffStage::Reference => "reference",
            TradeoffStage::Configurations => "configurations",
        };
        if bar.as_ref().is_none_or(|(of, _)| *of != what) {
            bar = Some((what, progress_bar(what, now.all)));
        }
        if let Some((_, bar)) = &bar {
            set_progress(bar, now.done, now.all);
        }
        ControlFlow::Continue(())
    })?;
    drop(bar);
    let (mut files, mut lost) = (Vec::new(), None);
    let nothing = nothing_measured(&found);
    // A picture of nothing isn't written.
    if let (Some(file), None) = (&arguments.plot, &nothing) {
        match plot::write(file, &found) {
            Ok(()) => files.push(file.clone()),
            Err(error) => lost = Some(error),
        }
    }
    output.result(&TradeoffReport::new(found, files));
    // What took the time is said all the same.
    if let Some(error) = &lost {
        output.error_for_people(error);
    }
    if let Some(why) = &nothing {
        output.error_for_people(why);
    }
    Ok(match nothing.is_none() && lost.is_none() {
        true => Exit::Done,
        false => Exit::Failed,
    })
}

/// Why no configuration has an error of its added mass, if none has.
fn nothing_measured(found: &Tradeoff) -> Option<String> {
    if (found.rows.iter()).any(|r| r.added_mass_rel_error.is_some()) {
        return None;
    }
    let failed = found.rows.iter().find_map(|row| {
        let error = row.error.as_ref()?;
        Some(format!("{}: {error}", row.configuration.label()))
    });
    Some(match failed {
        Some(first) => format!("no configuration could be measured, the first of them {first}"),
        None => format!(
            "no configuration was measured within the budget of {} s: give a longer --budget",
            found.budget
        ),
    })
}
