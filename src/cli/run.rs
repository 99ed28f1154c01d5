//! `hydrograd run`: a scene's trajectory.

use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::exit::Exit;
use super::export::Export;
use super::interrupt;
use super::options::Simulation;
use super::output::{
    ChoicesReport, Output, or_dash, peak_memory_mb, progress_bar, set_progress, write_warnings,
};
use super::video::{Video, Videos};
use crate::error::readable;
use crate::scene::Scene;
use crate::simulate::{
    Controls, Earlier, GapCheck, GapFlow, GapReport as GapEstimates, NearGap, Recording, Rollout,
};
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    simulation: Simulation,
    /// Folder for trajectory.csv and trajectory.json: time, q, v, energy, momentum, smallest gap, controls that acted
    /// [default: none are written]. Of a run that is interrupted (Ctrl-C) or fails in a step they hold what ran.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on from where the run that wrote this trajectory.json ended, to the bit, up to the number of steps counted from the scene's start. The scene
    /// and settings must be the same; trajectories written hold all steps from the start, the summary those made now.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Compare the water across the smallest gap of the run with that of coupled panels: the error of the added mass and of the force there. Takes
    /// their setup and a solve.
    #[arg(long)]
    check_gap: bool,
    #[command(flatten)]
    export: Export,
    #[command(flatten)]
    video: Video,
}

impl Arguments {
    /// Whether a video is asked for.
    pub fn asks_for_video(&self) -> bool {
        self.video.file.is_some()
    }

    /// Makes the video, if one is asked for.
    fn record(
        &self,
        videos: Option<&dyn Videos>,
        rollout: Rollout,
    ) -> std::result::Result<Vec<PathBuf>, String> {
        match videos.filter(|_| self.asks_for_video()) {
            Some(videos) => videos.record(rollout, &self.video),
            None => Ok(Vec::new()),
        }
    }
}

/// The smallest gap, by what ran and by coupled panels.
#[derive(Clone, Debug, Serialize)]
pub(super) struct GapReport {
    #[serde(flatten)]
    pub check: GapCheck,
    /// Relative.
    pub added_mass_error: f64,
    /// Relative.
    pub force_error: f64,
    /// The force, by panels, as a part of ½ M u²/h.
    pub force_share: f64,
}

impl From<GapCheck> for GapReport {
    fn from(check: GapCheck) -> Self {
        Self {
            added_mass_error: check.added_mass_error(),
            force_error: check.force_error(),
            force_share: check.force_share(),
            check,
        }
    }
}

/// Summary of a run. SI units.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RunReport {
    pub scene: String,
    #[serde(flatten)]
    pub choices: ChoicesReport,
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
    /// How far the energy rises above that at the start, at most, J.
    pub energy_gain: f64,
    /// How far it falls below that, at most, J.
    pub energy_loss: f64,
    /// Largest change of the momentum along a motion in which nothing outside acts, relative to the largest momentum of a single body; null
    /// where there is no such motion.
    pub momentum_drift: Option<f64>,
    /// Number of such motions.
    pub momenta_kept: usize,
    /// Smallest gap of the whole run, m; null where there is nothing to meet.
    pub min_gap: Option<f64>,
    /// By what the water across gaps is carried, and its estimated errors: at the smallest gap, and where that of the force is largest; when films came and went.
    pub gaps: GapEstimates,
    /// What the smallest gap is worth, with `--check-gap`; null without, where there is nothing to compare, and where that fails, which a warning says.
    pub gap_check: Option<GapReport>,
    /// Which of inertia and viscosity rules the water in the smallest gap; null where there is none.
    pub gap_flow: Option<GapFlow>,
    /// Largest gap at which surfaces are taken to touch, m; null where the scene has no contact.
    pub contact_gap: Option<f64>,
    /// Steps that were cut into pieces, being too long for what moved in them.
    pub cut_steps: usize,
    /// Most pieces of a step; one where none was cut.
    pub most_pieces: usize,
    pub final_q: Vec<f64>,
    pub final_v: Vec<f64>,
    pub warnings: Vec<String>,
    /// What was written.
    pub files: Vec<PathBuf>,
    /// Why other files that were asked for weren't.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
}

impl RunReport {
    /// Adds what is asked of the smallest gap once the run is done. A failure says nothing of the run: it is a warning.
    fn look_at_gap(&mut self, rollout: &Rollout, check: bool) {
        if check {
            match rollout.check_gap() {
                Ok(found) => self.gap_check = found.map(GapReport::from),
                Err(error) => {
                    let warning = format!("--check-gap: the smallest gap isn't checked: {error}");
                    self.warnings.push(warning);
                }
            }
        }
        match rollout.gap_flow() {
            Ok(found) => self.gap_flow = found,
            Err(error) => {
                let warning =
                    format!("what rules the water in the smallest gap isn't known: {error}");
                self.warnings.push(warning);
            }
        }
    }
}

pub(super) fn main(
    arguments: &Arguments,
    videos: Option<&dyn Videos>,
    output: Output,
) -> Result<Exit> {
    let scene = arguments.simulation.scene()?;
    arguments.video.check(&scene)?;
    if let Some(videos) = videos.filter(|_| arguments.asks_for_video())
        && let Err(why) = videos.prepare(&arguments.video)
    {
        output.error(&why);
        return Ok(Exit::Failed);
    }
    if let Some(folder) = &arguments.out {
        Recording::prepare(folder)?;
    }
    arguments.export.prepare(&scene)?;
    let earlier = arguments.resume.as_deref().map(Earlier::read).transpose()?;
    interrupt::listen();
    let progress = progress_bar("steps", scene.steps);
    let done = |done| set_progress(&progress, done, scene.steps);
    let Made {
        mut report,
        mut recording,
        rollout,
        halted,
    } = simulate(&scene, arguments, earlier.as_ref(), done)?;
    drop(progress);
    if let Some(earlier) = &earlier {
        earlier.put_before(&mut recording)?;
    }
    let mut kept = None;
    if let Some(folder) = &arguments.out {
        let files = recording
            .write(folder)
            .or_else(|e| rescued(&recording, e))?;
        kept = Some(files[1].clone());
        report.files = files.into();
    }
    let (files, lost) = arguments.export.write(&rollout);
    report.files.extend(files);
    // In JSON it is in the report, or left to why the run ended: there is one object.
    for error in lost {
        output.error_for_people(&error);
        report.lost.push(error.to_string());
    }
    // After what is kept, which neither a failure nor Ctrl-C may cost: it takes long.
    report.look_at_gap(&rollout, arguments.check_gap && halted.is_none());
    match arguments.record(videos, rollout) {
        Ok(files) => report.files.extend(files),
        Err(why) => {
            output.error_for_people(&why);
            report.lost.push(why);
        }
    }
    let Some(halted) = halted else {
        output.result(&report);
        return Ok(match report.lost.is_empty() {
            true => Exit::Done,
            false => Exit::Failed,
        });
    };
    let steps = recording.time.len() - 1;
    let kept = kept.map_or("nothing is kept without --out".into(), |file: PathBuf| {
        format!(
            "the {steps} steps before are kept in {0}; go on with --resume {0}",
            file.display()
        )
    });
    output.error(&format_args!("{halted}; {kept}"));
    Ok(Exit::Failed)
}

/// Writes what can't be written where it was asked for into a new folder for files for the time being, and says so.
fn rescued(recording: &Recording, error: Error) -> Result<[PathBuf; 2]> {
    let folder = tempfile::Builder::new().prefix("hydrograd-").tempdir();
    let Ok(folder) = folder else {
        return Err(error);
    };
    let Ok(files) = recording.write(folder.path()) else {
        return Err(error);
    };
    let folder = folder.keep();
    let Error::File { path, source, .. } = error else {
        return Err(error);
    };
    let said = format!("{source}; the run is kept in {} instead", folder.display());
    let _ = files;
    Err(Error::File {
        path,
        action: "write",
        source: io::Error::new(source.kind(), said),
    })
}

/// What came of a run.
struct Made {
    report: RunReport,
    recording: Recording,
    rollout: Rollout,
    /// Why it ended before its time, if it did.
    halted: Option<Error>,
}

/// Makes the scene ready, runs up to `scene.steps` steps, and gathers report and trajectory.
fn simulate(
    scene: &Scene,
    arguments: &Arguments,
    earlier: Option<&Earlier>,
    mut done: impl FnMut(usize) + Send,
) -> Result<Made> {
    let start = Instant::now();
    let Simulation { water, .. } = &arguments.simulation;
    let simulator = water.simulator(scene, arguments.simulation.settings())?;
    let setup_seconds = start.elapsed().as_secs_f64();
    let state = match earlier {
        Some(e) => simulator.resume(e.state(), &e.path().display().to_string())?,
        None => simulator.initial().map_err(|e| e.at_time(0.0))?,
    };
    if let Some(earlier) = earlier {
        // A file with other rows is refused before the run, which would be lost after it.
        let begun = simulator.rollout_from(&state, &Controls::zeros(&simulator, 0), |_| {
            ControlFlow::Continue(())
        })?;
        earlier.put_before(&mut Recording::of(scene, &begun)?)?;
    }
    let before = state.step;
    let Some(steps) = scene.steps.checked_sub(before) else {
        return Err(Error::input(
            "--resume: steps made",
            before,
            format!(
                "must be at most the {} of the run; give more --steps",
                scene.steps
            ),
        ));
    };
    let controls = Controls::zeros(&simulator, steps);
    let ran = interrupt::while_running(|go_on| {
        simulator.rollout_as_far(&state, &controls, |made| {
            done(before + made);
            go_on()
        })
    });
    let (rollout, halted) = match ran {
        Ok(rollout) => (rollout, None),
        Err(halted) => match halted.rollout {
            Some(rollout) => (rollout, Some(halted.error)),
            None => return Err(halted.error),
        },
    };
    let seconds = start.elapsed().as_secs_f64();
    let summary = rollout.summary();
    let last = &rollout.samples()[rollout.steps()];
    let report = RunReport {
        scene: scene.name.clone(),
        choices: ChoicesReport::new(&simulator),
        bodies: scene.bodies.len(),
        faces: simulator.faces(),
        unknowns: simulator.unknowns(),
        steps: summary.steps,
        dt: simulator.time_step(),
        seconds,
        setup_seconds,
        seconds_per_step: (seconds - setup_seconds) / summary.steps.max(1) as f64,
        peak_memory_mb: peak_memory_mb(),
        energy_initial: summary.energy_initial,
        energy_final: summary.energy_final,
        energy_gain: summary.energy_gain,
        energy_loss: summary.energy_loss,
        momentum_drift: summary.momentum_drift,
        momenta_kept: summary.momenta_kept,
        min_gap: summary.min_gap,
        gaps: summary.gaps,
        gap_check: None,
        gap_flow: None,
        contact_gap: summary.contact_gap,
        cut_steps: summary.cut_steps,
        most_pieces: summary.most_pieces,
        final_q: last.q.as_slice().to_vec(),
        final_v: last.v.as_slice().to_vec(),
        warnings: [simulator.warnings(), &rollout.warnings()].concat(),
        files: Vec::new(),
        lost: Vec::new(),
    };
    Ok(Made {
        report,
        recording: Recording::of(scene, &rollout)?,
        rollout,
        halted,
    })
}

/// A gap's estimated errors in words.
fn estimated(place: &str, gap: &NearGap) -> String {
    let (first, second) = &gap.bodies;
    let second = second
        .as_ref()
        .map_or("a wall".into(), |b| format!("{b:?}"));
    format!(
        "{place}, {first:?} and {second} at t = {} s, the water is carried by {}: estimated error of the added mass {:.1} %, of the force {:.0} %",
        readable(gap.time),
        gap.carried.by(),
        1e2 * gap.added_mass_error,
        1e2 * gap.force_error
    )
}

impl fmt::Display for RunReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let choices = &self.choices;
        let used = match choices.fidelity_used == choices.fidelity {
            true => choices.fidelity.to_string(),
            false => format!("{}: {}", choices.fidelity, choices.fidelity_used),
        };
        writeln!(
            f,
            "{}: {} steps of {} s, {used} (bodies by {}, {})",
            self.scene, self.steps, self.dt, choices.method, choices.integrator
        )?;
        for reason in &choices.chosen {
            writeln!(f, "  chosen  {reason}")?;
        }
        writeln!(f, "  backend {}", choices.backend)?;
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
            "  energy  {:.6e} J at the start, {:.6e} J at the end; at most {:.2e} J above and {:.2e} J below the start",
            self.energy_initial, self.energy_final, self.energy_gain, self.energy_loss
        )?;
        match self.momentum_drift {
            Some(drift) => writeln!(
                f,
                "  momentum changes by {drift:.2e} of the largest in the {} directions in which nothing outside acts",
                self.momenta_kept
            )?,
            None => writeln!(f, "  momentum in every direction something outside acts")?,
        }
        writeln!(f, "  smallest gap   {}", or_dash(self.min_gap, "m"))?;
        let worst = self.gaps.worst.as_ref();
        let nearest = self.gaps.nearest.as_ref();
        if let Some(near) = nearest {
            writeln!(f, "  {}", estimated("there", near))?;
        }
        if let Some(worst) =
            worst.filter(|w| nearest.is_some_and(|n| n.force_error < w.force_error))
        {
            let place = format!("least certain at a gap of {:.3e} m", worst.gap);
            writeln!(f, "  {}", estimated(&place, worst))?;
        }
        if self.gaps.changes > 0 {
            writeln!(
                f,
                "  films come or go {} times, first at t = {} s",
                self.gaps.changes,
                readable(self.gaps.first_changes[0].time)
            )?;
        }
        if let Some(gap) = &self.gap_check {
            writeln!(
                f,
                "  there, at t = {} s, against coupled panels ({} faces): added mass {:+.2} %, force {:+.2} % of a force that is {:.2} % of M u²/2h",
                readable(gap.check.time),
                gap.check.faces,
                1e2 * gap.added_mass_error,
                1e2 * gap.force_error,
                1e2 * gap.force_share
            )?;
        }
        if let Some(flow) = &self.gap_flow {
            write!(
                f,
                "  there, at up to {:.3e} m/s: film Reynolds number {:.3e}, viscous over inertial pressure {:.3e}",
                flow.speed, flow.film_reynolds, flow.viscous_over_inertial
            )?;
            if let Some(stokes) = flow.stokes {
                write!(f, ", Stokes number {stokes:.3e}")?;
            }
            match flow.advice() {
                Some(advice) => writeln!(f, ": {advice}")?,
                None => writeln!(f)?,
            }
        }
        if self.contact_gap.is_some() {
            writeln!(
                f,
                "  surfaces touch at gaps of up to {}",
                or_dash(self.contact_gap, "m")
            )?;
        }
        if self.cut_steps > 0 {
            writeln!(
                f,
                "  steps   {} of {} cut into pieces, at most {}",
                self.cut_steps, self.steps, self.most_pieces
            )?;
        }
        writeln!(f, "  final q {:?}", self.final_q)?;
        write!(f, "  final v {:?}", self.final_v)?;
        for file in &self.files {
            write!(f, "\n  wrote   {}", file.display())?;
        }
        write_warnings(f, &self.warnings)
    }
}
