//! What one configuration says and what it costs.

use super::configuration::Configuration;
use super::progress::Watch;
use super::reference::Reference;
use super::row::TradeoffRow;
use super::start::{Path, Start};
use crate::scene::Scene;
use crate::simulate::{Simulator, gradcheck};
use crate::{Error, Result};
use std::time::Instant;

/// Steps of a timed rollout, and repetitions of which the median is taken.
const STEPS: usize = 20;
const REPETITIONS: usize = 5;
/// What a timed rollout with its gradient costs, in rollouts: an estimate.
const GRADIENT: f64 = 3.5;
/// A time that needs no longer measuring, s.
const ENOUGH: f64 = 0.2;
/// Most repetitions.
const MOST: usize = 101;

/// A measured configuration.
pub(super) struct Measured {
    pub row: TradeoffRow,
    pub warnings: Vec<String>,
}

/// Measures a configuration in about `allowance` seconds. What couldn't be found is missing in the row,
/// with the reason.
pub(super) fn measure(
    scene: &Scene,
    configuration: &Configuration,
    reference: &Reference,
    allowance: f64,
    watch: &mut Watch,
) -> Measured {
    let mut out = Measured {
        row: TradeoffRow::new(*configuration),
        warnings: Vec::new(),
    };
    if let Err(error) = fill(&mut out, scene, reference, allowance, watch) {
        out.row.error = Some(error.to_string());
    }
    out
}

fn fill(
    Measured { row, warnings }: &mut Measured,
    scene: &Scene,
    reference: &Reference,
    allowance: f64,
    watch: &mut Watch,
) -> Result<()> {
    let begin = Instant::now();
    let simulator = Simulator::new(scene, row.configuration.settings())?;
    let setup = begin.elapsed().as_secs_f64();
    row.setup_seconds = Some(setup);
    watch.check()?;
    // Whoever waits for the setting up can wait as long for the steps.
    let begin = Instant::now();
    let allowance = (allowance - setup).max(setup);
    let left = || allowance - begin.elapsed().as_secs_f64();
    describe(row, &simulator);
    *warnings = simulator.warnings().to_vec();
    let start = Start::values(&simulator)?;
    row.added_mass_rel_error = reference.added_mass_error(&start);
    let start = start.with_forces(&simulator)?;
    row.acceleration_rel_error = reference.acceleration_error(&start);

    // The first step warms up and tells, roughly, what the others will take.
    let first = Instant::now();
    Path::new(&simulator, 1, watch)?;
    let mut step = first.elapsed().as_secs_f64();
    let horizon = reference.horizon();
    let steps = (horizon / simulator.time_step() * (1.0 + 1e-9)) as usize;
    let needed = step * steps as f64;
    if steps == 0 {
        row.add_note("the time step is longer than the horizon: no end state");
    } else if needed > left() {
        row.add_note(format!(
            "no end state: its {needed:.1} s are too long for the budget"
        ));
    } else {
        let all = Instant::now();
        let path = Path::new(&simulator, steps, watch)?;
        step = all.elapsed().as_secs_f64() / steps as f64;
        row.ms_per_step = Some(1e3 * step);
        row.end_state_rel_error = reference.end_error(&path);
        if row.end_state_rel_error.is_none() && reference.moves() {
            row.add_note("no end state: the time steps don't meet those of the reference");
        }
    }
    let most = steps.clamp(1, STEPS);
    time(row, &simulator, most, step, left().max(0.1 * allowance))
}

/// What the bodies became.
fn describe(row: &mut TradeoffRow, simulator: &Simulator) {
    row.faces = Some(simulator.faces());
    row.unknowns = Some(simulator.unknowns());
    let points: usize = simulator.discretisation().iter().map(|d| d.points).sum();
    row.points = Some(points).filter(|p| *p > 0);
    row.fidelity_used = simulator.fidelity();
}

/// Medians over repeated rollouts, with and without gradient, as many as `allowance` s have room for.
fn time(
    row: &mut TradeoffRow,
    simulator: &Simulator,
    most: usize,
    step: f64,
    allowance: f64,
) -> Result<()> {
    // One rollout for the scales and one repetition to warm up come with every measurement.
    let cost = |steps: usize, repetitions: usize| {
        step * steps as f64 * (1.0 + (repetitions + 1) as f64 * GRADIENT)
    };
    let choices = [
        (most, REPETITIONS),
        (most, 3),
        (most.div_ceil(2), 3),
        (most.div_ceil(4), 3),
        (most.div_ceil(4), 1),
    ];
    let fits = choices.into_iter().find(|(n, r)| cost(*n, *r) <= allowance);
    let needed = cost(1, 1);
    let Some((steps, least)) = fits.or((needed <= 2.0 * allowance).then_some((1, 1))) else {
        row.add_note(format!(
            "no gradient: its {needed:.1} s are too long for the budget"
        ));
        row.ms_per_step.get_or_insert(1e3 * step);
        return Ok(());
    };
    let mut repetitions = least;
    while repetitions < MOST && cost(steps, repetitions) < ENOUGH.min(allowance) {
        repetitions += 2;
    }
    let times = gradcheck::timings(simulator, steps, repetitions)?;
    row.ms_per_step = Some(1e3 * times.forward / steps as f64);
    row.ms_per_gradient_step = Some(1e3 * times.gradient / steps as f64);
    row.timed_steps = Some(steps);
    row.timed_repetitions = Some(repetitions);
    if times.forward.is_nan() || times.forward <= 0.0 {
        return Err(Error::input(
            "timing",
            times.forward,
            "the clock of this machine is too coarse for so short a run",
        ));
    }
    Ok(())
}
