//! What one configuration says and what it costs.

use std::time::Instant;

use nalgebra::{DMatrix, DVector};

use super::configurations::Configuration;
use super::reference::Reference;
use super::report::Row;
use crate::cli::options::name;
use crate::dynamics::{Drive, Evaluation};
use crate::scene::Scene;
use crate::simulate::{Controls, Fidelity, Observation, Simulator, gradcheck};
use crate::{Error, Result};

/// Steps of a timed rollout, and repetitions of which the median is taken.
const STEPS: usize = 20;
const REPETITIONS: usize = 5;
/// What a timed rollout with its gradient costs, in rollouts: an estimate.
const GRADIENT: f64 = 3.5;
/// A time that needs no longer measuring, s.
const ENOUGH: f64 = 0.2;
/// Most repetitions.
const MOST: usize = 101;

/// The scene at its start, over the velocities that forces decide.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// Water's part of the mass matrix, JᵀM_fJ: kg, kg m, kg m².
    pub added_mass: DMatrix<f64>,
    /// The mass matrix.
    pub mass: DMatrix<f64>,
    /// The mass matrix times the acceleration; zeros where only values were asked for.
    pub force: DVector<f64>,
}

impl Start {
    /// M_f and M alone.
    ///
    /// # Errors
    /// Whatever the coupling reports.
    pub fn values(simulator: &Simulator) -> Result<Self> {
        let e = (simulator.system()).evaluate(simulator.parameters(), simulator.start().0)?;
        let force = DVector::zeros(free(simulator).len());
        Self::new(simulator, &e, force)
    }

    /// With the forces on it: the scene's own, and those that its velocity makes.
    ///
    /// # Errors
    /// Whatever the coupling reports, and a method without derivatives.
    pub fn with_forces(simulator: &Simulator) -> Result<Self> {
        let (q, v) = simulator.start();
        let e = (simulator.system()).linearise(simulator.parameters(), q)?;
        let control = action(simulator).0;
        let given = given_accelerations(simulator);
        let force = e.inertial_force(v, &control)? - &e.mass_matrix * given;
        Self::new(simulator, &e, force.select_rows(&free(simulator)))
    }

    fn new(simulator: &Simulator, e: &Evaluation, force: DVector<f64>) -> Result<Self> {
        let mut dry = simulator.parameters().clone();
        *dry.density_mut() = 0.0;
        let rigid = (simulator.system()).evaluate(&dry, simulator.start().0)?;
        let free = free(simulator);
        let block = |m: &DMatrix<f64>| m.select_rows(&free).select_columns(&free);
        Ok(Self {
            added_mass: block(&(&e.mass_matrix - rigid.mass_matrix)),
            mass: block(&e.mass_matrix),
            force,
        })
    }

    /// The same with another M_f.
    pub fn with_added_mass(&self, added_mass: DMatrix<f64>) -> Self {
        Self {
            added_mass,
            ..self.clone()
        }
    }

    /// Acceleration under the forces and a further one.
    pub fn acceleration(&self, extra: &DVector<f64>) -> Option<DVector<f64>> {
        let factor = self.mass.clone().cholesky()?;
        Some(factor.solve(&(&self.force + extra)))
    }
}

/// Controls and held bodies of the first step.
fn action(simulator: &Simulator) -> (DVector<f64>, Vec<bool>) {
    let (q, v) = simulator.start();
    let action = simulator.policy().act(&Observation {
        step: 0,
        time: 0.0,
        q,
        v,
        mode: 0,
    });
    let mut control = DVector::zeros(simulator.system().controls);
    for (c, x) in control.iter_mut().zip(action.control) {
        *c += x;
    }
    (control, action.hold)
}

/// Numbers of the velocities that forces decide at the start.
pub(super) fn free(simulator: &Simulator) -> Vec<usize> {
    let system = simulator.system();
    let hold = action(simulator).1;
    let links = system.tree.links().iter().zip(&system.drives).enumerate();
    links
        .filter(|(b, (_, drive))| **drive == Drive::Free && !hold.get(*b).copied().unwrap_or(false))
        .flat_map(|(_, (link, _))| link.v.clone())
        .collect()
}

/// Accelerations of joints with a given motion, zero for others.
fn given_accelerations(simulator: &Simulator) -> DVector<f64> {
    let system = simulator.system();
    let mut out = DVector::zeros(system.tree.velocities());
    for (link, drive) in system.tree.links().iter().zip(&system.drives) {
        if let Drive::Motion(motions) = drive {
            for (i, motion) in link.v.clone().zip(motions) {
                out[i] = motion.acceleration(0.0);
            }
        }
    }
    out
}

/// A trajectory's coordinates and velocities.
#[derive(Clone, Debug)]
pub(super) struct Path {
    /// Time step, s.
    pub time_step: f64,
    pub q: Vec<DVector<f64>>,
    pub v: Vec<DVector<f64>>,
}

impl Path {
    /// # Errors
    /// The first step that fails.
    pub fn new(simulator: &Simulator, steps: usize) -> Result<Self> {
        let rollout = simulator.rollout(&Controls::zeros(simulator, steps))?;
        let samples = rollout.samples();
        Ok(Self {
            time_step: simulator.time_step(),
            q: samples.iter().map(|s| s.q.clone()).collect(),
            v: samples.iter().map(|s| s.v.clone()).collect(),
        })
    }
}

/// Measures a configuration in about `allowance` seconds. What can't be had is missing in the row,
/// with the reason.
pub(super) fn measure(
    scene: &Scene,
    configuration: &Configuration,
    reference: &Reference,
    allowance: f64,
) -> Row {
    let mut row = Row::new(configuration);
    if let Err(error) = fill(&mut row, scene, configuration, reference, allowance) {
        row.error = Some(error.to_string());
    }
    row
}

fn fill(
    row: &mut Row,
    scene: &Scene,
    configuration: &Configuration,
    reference: &Reference,
    allowance: f64,
) -> Result<()> {
    let begin = Instant::now();
    let simulator = Simulator::new(scene, configuration.settings)?;
    let setup = begin.elapsed().as_secs_f64();
    row.setup_seconds = Some(setup);
    // Whoever waits for the setting up can wait as long for the steps.
    let begin = Instant::now();
    let allowance = (allowance - setup).max(setup);
    let left = || allowance - begin.elapsed().as_secs_f64();
    describe(row, &simulator);
    row.added_mass_rel_error = reference.added_mass_error(&Start::values(&simulator)?);
    let start = Start::with_forces(&simulator)?;
    row.acceleration_rel_error = reference.acceleration_error(&start);

    // The first step warms up and tells, roughly, what the others will take.
    let first = Instant::now();
    Path::new(&simulator, 1)?;
    let mut step = first.elapsed().as_secs_f64();
    let horizon = reference.horizon();
    let steps = (horizon / simulator.time_step() * (1.0 + 1e-9)) as usize;
    if steps == 0 {
        row.say("the time step is longer than the horizon: no end state");
    } else if step * steps as f64 > left() {
        let needed = step * steps as f64;
        row.say(format!(
            "no end state: its {needed:.1} s are too long for the budget"
        ));
    } else {
        let all = Instant::now();
        let path = Path::new(&simulator, steps)?;
        step = all.elapsed().as_secs_f64() / steps as f64;
        row.ms_per_step = Some(1e3 * step);
        row.end_state_rel_error = reference.end_error(&path);
        if row.end_state_rel_error.is_none() && reference.moves() {
            row.say("no end state: the time steps don't meet those of the reference");
        }
    }
    time(
        row,
        &simulator,
        steps.clamp(1, STEPS),
        step,
        left().max(0.1 * allowance),
    )
}

/// What the bodies became.
fn describe(row: &mut Row, simulator: &Simulator) {
    row.faces = Some(simulator.faces());
    row.unknowns = Some(simulator.unknowns());
    let points: usize = simulator.discretisation().iter().map(|d| d.points).sum();
    row.points = Some(points).filter(|p| *p > 0);
    let used = simulator.fidelity();
    row.fidelity_used = name(used);
    if used != simulator.settings().fidelity && used == Fidelity::Full {
        row.say("auto chose full: the gaps are too small for compressed bodies");
    }
}

/// Medians over repeated rollouts, with and without gradient, as many as `allowance` s have room for.
fn time(
    row: &mut Row,
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
    let Some((steps, least)) = fits.or((cost(1, 1) <= 2.0 * allowance).then_some((1, 1))) else {
        let needed = cost(1, 1);
        row.say(format!(
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
