//! Time per step against error, for a scene, over everything that can be chosen.
//!
//! [`measure`] simulates a scene in many configurations: fidelities, methods for a body alone, faces, points and accuracies
//! of compressed bodies, tolerances, integrators and time steps, each varied around the scene's own choice. Every
//! configuration is timed by itself, one after another, with and without the gradient, and held against a reference: the
//! added mass against coupled panels on finer and finer meshes, accelerations and end states against compressed bodies of
//! high accuracy with a quarter of the time step. Rows that nothing faster beats in accuracy are marked.
//!
//! ```no_run
//! use hydrograd::tradeoff::{self, TradeoffSettings};
//! use std::ops::ControlFlow;
//!
//! # fn main() -> hydrograd::Result<()> {
//! let scene = hydrograd::Scene::load("scene.toml")?;
//! let settings = TradeoffSettings { budget: Some(60.0), ..Default::default() };
//! let found = tradeoff::measure(&scene, &settings, |_| ControlFlow::Continue(()))?;
//! for row in found.rows.iter().filter(|r| r.pareto) {
//!     println!("{}: {:?} ms, {:?}", row.configuration.label(), row.ms_per_step, row.added_mass_rel_error);
//! }
//! # Ok(())
//! # }
//! ```

mod compare;
mod configuration;
mod measure;
mod plan;
mod progress;
mod reference;
mod row;
mod settings;
mod shapes;
mod start;

pub use configuration::{Configuration, Family};
#[cfg(feature = "cli")]
pub(crate) use configuration::{short, three_digits};
pub use plan::configurations;
pub use progress::{TradeoffProgress, TradeoffStage};
pub use row::{ReferenceQuantity, TradeoffReference, TradeoffRow};
pub use settings::TradeoffSettings;

use crate::Result;
use crate::coupling::reduced::cache;
use crate::scene::Scene;
use plan::{expected, order};
use progress::Watch;
use reference::{Limits, Reference};
use row::conclude;
use serde::Serialize;
use std::ops::ControlFlow;
use std::time::Instant;

/// Time for everything, unless told otherwise, s.
const BUDGET: f64 = 120.0;
/// Of a longer budget the reference takes its part of this one, s: clocks don't hold all numbers.
const LONGEST: f64 = 1e9;
/// Part of the budget that the reference may take.
const FOR_REFERENCE: f64 = 0.4;
/// What one configuration may take, as a multiple of an equal share of the time that is left.
const SHARE: f64 = 4.0;
/// Steps over which trajectories are compared, unless the scene has fewer.
const STEPS: usize = 50;

/// Times and errors of a scene's configurations.
#[derive(Clone, Debug, Serialize)]
pub struct Tradeoff {
    /// Name of the scene.
    pub scene: String,
    /// What errors are measured against.
    pub reference: TradeoffReference,
    /// The configurations that were measured, fidelity by fidelity.
    pub rows: Vec<TradeoffRow>,
    /// Configurations that the budget had no time for.
    pub left_out: Vec<String>,
    /// The time that was given, s.
    pub budget: f64,
    /// Wall time of everything, s.
    pub seconds: f64,
    /// Threads that a step may use.
    pub threads: usize,
    /// What the user should know about the scene: the warnings of the configurations that others are varied around.
    pub warnings: Vec<String>,
}

/// Computes the reference, then measures all configurations one after another while there is time. `progress` is called
/// with how far that has come, often, and may end it.
///
/// A configuration that can't be simulated is a row with its error.
///
/// # Errors
/// Settings out of range; a scene that doesn't validate, without water, or where nothing can move; a scene for which no
/// method gives a reference; [`crate::Error::Stopped`] if `progress` breaks.
pub fn measure(
    scene: &Scene,
    settings: &TradeoffSettings,
    mut progress: impl FnMut(TradeoffProgress) -> ControlFlow<()> + Send,
) -> Result<Tradeoff> {
    let configurations = configurations(scene, settings)?;
    let begin = Instant::now();
    let budget = settings.budget.unwrap_or(BUDGET);
    let left = || budget - begin.elapsed().as_secs_f64();
    let mut watch = Watch::new(&mut progress);
    let limits = Limits {
        seconds: FOR_REFERENCE * budget.min(LONGEST),
        faces: settings.reference_faces,
        steps: horizon(scene, settings.steps),
    };
    let reference = Reference::new(scene, limits, &mut watch)?;
    // Bodies that the reference compressed would make setting up look cheaper than it is.
    cache::forget();

    watch.configurations(configurations.len())?;
    let mut rows: Vec<Option<TradeoffRow>> = vec![None; configurations.len()];
    let mut warnings = Vec::new();
    for (done, i) in order(&configurations).into_iter().enumerate() {
        let configuration = &configurations[i];
        let waiting = configurations.len() - done;
        if left() > 0.0 && expected(configuration, &rows) <= left() {
            let allowance = (SHARE * left() / waiting as f64).min(left());
            let mut measured =
                measure::measure(scene, configuration, &reference, allowance, &mut watch);
            set_up_before(&mut measured.row, &rows);
            rows[i] = Some(measured.row);
            if configuration.family == Family::Base {
                warnings.extend(measured.warnings);
            }
        }
        watch.advance()?;
    }
    let missing = configurations
        .iter()
        .zip(&rows)
        .filter(|(_, row)| row.is_none());
    let left_out = missing.map(|(c, _)| c.label()).collect();
    let mut rows: Vec<TradeoffRow> = rows.into_iter().flatten().collect();
    // The configurations begin with one of each fidelity.
    let fidelity = |c: &Configuration| configurations.iter().position(|d| d.fidelity == c.fidelity);
    rows.sort_by_key(|row| fidelity(&row.configuration));
    conclude(&mut rows, &reference.description);
    warnings.sort_unstable();
    warnings.dedup();
    Ok(Tradeoff {
        scene: scene.name.clone(),
        reference: reference.description,
        rows,
        left_out,
        budget,
        seconds: begin.elapsed().as_secs_f64(),
        threads: rayon::current_num_threads(),
        warnings,
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

/// Compressed bodies are kept in memory: the time to set up is that of the first row that had them made.
fn set_up_before(row: &mut TradeoffRow, rows: &[Option<TradeoffRow>]) {
    let same = |r: &&TradeoffRow| r.configuration.couples_like(&row.configuration);
    let before = rows.iter().flatten().filter(same);
    let longest = before.filter_map(|r| r.setup_seconds).fold(0.0, f64::max);
    row.setup_seconds = row.setup_seconds.map(|s| s.max(longest));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Fluid;

    #[test]
    fn horizons_divide_by_four() {
        let mut scene = Scene::new(Fluid::fresh_water());
        for (steps, expected) in [(100, 48), (23, 20), (4, 4), (3, 3), (0, 1)] {
            scene.steps = steps;
            assert_eq!(horizon(&scene, None), expected);
        }
        assert_eq!(horizon(&scene, Some(7)), 7);
    }
}
