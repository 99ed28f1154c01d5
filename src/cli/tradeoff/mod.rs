//! `hydrograd tradeoff`: time per step against error, over everything that can be chosen.

mod compare;
mod configurations;
mod measure;
mod pareto;
mod plot;
mod reference;
mod report;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;

use super::options::positive;
use super::output::Output;
use super::progress::Progress;
use crate::coupling::reduced::cache;
use crate::scene::Scene;
use crate::simulate::Fidelity;
use crate::{Error, Result};
use configurations::{Configuration, Family, Lists, plan, seconds};
use measure::measure;
use reference::{Limits, Reference};
use report::{FRONTS, Report, Row, conclude};

/// Part of the budget that the reference may take.
const FOR_REFERENCE: f64 = 0.4;
/// What one row may take, as a multiple of an equal share of the time that is left.
const SHARE: f64 = 4.0;
/// Steps over which trajectories are compared, unless the scene has fewer.
const STEPS: usize = 50;
/// How setting up and stepping grow with the number of faces, at most: a guess, with a factor against
/// starting what can't end in time.
const GROWTH: f64 = 2.5;

#[derive(Debug, Args)]
#[command(
    after_help = "Errors are relative: of the added mass against coupled panels on finer and finer \
                  meshes, of accelerations and end states against compressed bodies of high accuracy \
                  with a quarter of the time step. Each configuration is timed by itself, one after \
                  another."
)]
pub(super) struct Arguments {
    /// The scene file.
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    #[command(flatten)]
    lists: Lists,
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

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<ExitCode> {
    let mut scene = Scene::load(&arguments.scene)?;
    if scene.name.is_empty() {
        let stem = arguments.scene.file_stem().unwrap_or_default();
        scene.name = stem.to_string_lossy().into_owned();
    }
    scene.validate()?;
    if let Some(file) = &arguments.plot {
        plot::prepare(file)?;
    }
    let mut report = compare(&scene, arguments)?;
    if let Some(file) = &arguments.plot {
        plot::write(file, &report)?;
        report.files.push(file.clone());
    }
    output.result(&report);
    Ok(
        if report.rows.iter().any(|r| r.added_mass_rel_error.is_some()) {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        },
    )
}

/// The reference, then all configurations one after another while there is time.
fn compare(scene: &Scene, arguments: &Arguments) -> Result<Report> {
    let begin = Instant::now();
    let left = || arguments.budget - begin.elapsed().as_secs_f64();
    let progress = Progress::new("reference", 10);
    let limits = Limits {
        seconds: FOR_REFERENCE * arguments.budget,
        faces: arguments.reference_faces,
        steps: horizon(scene, arguments.steps),
    };
    let mut parts = 0;
    let reference = Reference::new(scene, limits, &mut || {
        parts += 1;
        progress.set_of(parts, (parts + 1).max(10));
    })?;
    drop(progress);
    // Bodies that the reference compressed would make setting up look cheaper than it is.
    cache::forget();

    let configurations = plan(scene, &arguments.lists);
    let progress = Progress::new("configurations", configurations.len());
    let mut rows: Vec<Option<Row>> = vec![None; configurations.len()];
    for (done, i) in order(&configurations).into_iter().enumerate() {
        let configuration = &configurations[i];
        let waiting = configurations.len() - done;
        if left() > 0.0 && expected(configuration, &rows) <= left() {
            let allowance = (SHARE * left() / waiting as f64).min(left());
            let mut row = measure(scene, configuration, &reference, allowance);
            set_up_before(&mut row, &rows);
            rows[i] = Some(row);
        }
        progress.set(done + 1);
    }
    drop(progress);
    let missing = configurations
        .iter()
        .zip(&rows)
        .filter(|(_, row)| row.is_none());
    let left_out = missing.map(|(c, _)| c.label()).collect();
    let mut rows: Vec<Row> = rows.into_iter().flatten().collect();
    let fidelities: Vec<Fidelity> = configurations.iter().map(|c| c.settings.fidelity).collect();
    let place = |r: &Row| {
        fidelities
            .iter()
            .position(|f| *f == r.configuration.settings.fidelity)
    };
    rows.sort_by_key(place);
    conclude(&mut rows, &reference.said);
    Ok(Report {
        scene: scene.name.clone(),
        reference: reference.said,
        rows,
        fronts: FRONTS,
        left_out,
        budget: arguments.budget,
        seconds: begin.elapsed().as_secs_f64(),
        threads: rayon::current_num_threads(),
        warnings: Vec::new(),
        files: Vec::new(),
    })
}

/// Steps of the scene's own length; a multiple of four, so that steps of four times that length end
/// there too.
fn horizon(scene: &Scene, asked: Option<usize>) -> usize {
    let steps = asked.unwrap_or(scene.steps.clamp(1, STEPS));
    match asked {
        None if steps > 4 => steps - steps % 4,
        _ => steps,
    }
}

/// The order in which configurations are measured, so that what the budget has no time for matters
/// least: first what all else is varied around, then some of everything, and the dear ones last.
fn order(configurations: &[Configuration]) -> Vec<usize> {
    let mut out: Vec<usize> = (0..configurations.len()).collect();
    out.sort_by_key(|i| {
        let c = &configurations[*i];
        let dear = c.settings.fidelity == Fidelity::Full;
        // Faces left to the scene are usually the most.
        let faces = c.settings.faces.unwrap_or(usize::MAX);
        let like =
            |d: &&Configuration| (d.family, d.settings.fidelity) == (c.family, c.settings.fidelity);
        let place = configurations[..*i].iter().filter(like).count();
        (
            c.family != Family::Base,
            dear,
            if dear { faces } else { 0 },
            place,
        )
    });
    out
}

/// Seconds that a configuration takes at least, guessed from the same with fewer faces.
fn expected(configuration: &Configuration, rows: &[Option<Row>]) -> f64 {
    let Some(faces) = configuration.settings.faces else {
        return 0.0;
    };
    let like = |c: &Configuration| {
        let (a, b) = (&c.settings, &configuration.settings);
        a.fidelity == b.fidelity && a.method_name() == b.method_name()
    };
    let known = rows.iter().flatten().filter_map(|row| {
        let fewer = row.configuration.settings.faces.filter(|f| *f < faces)?;
        let seconds = row.setup_seconds? + 1e-3 * row.ms_per_step?;
        like(&row.configuration).then(|| seconds * (faces as f64 / fewer as f64).powf(GROWTH))
    });
    known.fold(0.0, f64::max)
}

/// Compressed bodies are kept in memory: the time to set up is that of the first row that had them made.
fn set_up_before(row: &mut Row, rows: &[Option<Row>]) {
    let coupling = row.configuration.coupling();
    let same = |r: &&Row| r.configuration.coupling() == coupling;
    let before = rows.iter().flatten().filter(same);
    let longest = before.filter_map(|r| r.setup_seconds).fold(0.0, f64::max);
    row.setup_seconds = row.setup_seconds.map(|s| s.max(longest));
}

/// What is asked of a file before hours are spent on it.
fn refuse(file: &std::path::Path, expected: &str) -> Error {
    Error::input("--plot", file.display().to_string(), expected.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cheap_configurations_come_first() {
        let scene = crate::scene::Scene::new(crate::scene::Fluid::fresh_water());
        let plan = plan(&scene, &Lists::default());
        let order = order(&plan);
        assert!(order[..4].iter().all(|i| plan[*i].family == Family::Base));
        let full = |i: &usize| plan[*i].settings.fidelity == Fidelity::Full;
        let rest = &order[4..];
        let first = rest.iter().position(full).unwrap();
        assert!(rest[first..].iter().all(full));
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, n)| i == *n));
    }

    #[test]
    fn horizons_divide_by_four() {
        let mut scene = crate::scene::Scene::new(crate::scene::Fluid::fresh_water());
        for (steps, expected) in [(100, 48), (23, 20), (4, 4), (3, 3), (0, 1)] {
            scene.steps = steps;
            assert_eq!(horizon(&scene, None), expected);
        }
        assert_eq!(horizon(&scene, Some(7)), 7);
    }
}
