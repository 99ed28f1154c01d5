//! Controls over a horizon by iterated linear–quadratic regulation.
//!
//! A trajectory is linearised knot by knot (the simulator's own Jacobians of steps, [`Rollout::step_jacobians`], chained over the steps of a knot; the cost by Gauss and Newton), a
//! sweep from the last knot to the first finds the controls that are best by that model, within their limits (a projected Newton step at each knot), and how they answer to changes
//! of the state; the simulator then runs with them. A step that doesn't lower the cost as it should is halved; where none does, or one of an eighth at most, the model is regularised. Derivatives of second
//! order of the dynamics are left out. Controls that have no slope where they are, as thrusters at rest, have the one that they have farther off. States are compared on their manifold (`x ⊖ x̄`): free bodies turn as they like.
//!
//! A scene's own controller acts as always; the controls here are the open-loop ones, to which it adds. The numbers don't depend on the number of threads.
//!
//! No crate fits: `optimization_engine` descends gradients alone and yields no feedback, `lqr` takes constant gains as given, and neither takes steps' Jacobians or states
//! with rotations.
//!
//! # References
//! Y. Tassa, N. Mansard, E. Todorov, "Control-limited differential dynamic programming", ICRA 2014; W. Li, E. Todorov, "Iterative linear quadratic regulator design for nonlinear
//! biological movement systems", ICINCO 2004; D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963.

mod backward;
mod box_qp;
mod idle;
mod plan;
mod problem;
mod settings;
mod tracking;
mod trust;

pub use plan::{Guess, Plan};
pub use problem::Problem;
pub use settings::{IlqrProgress, IlqrSettings, IlqrStop, IlqrTimes};
pub use tracking::{Track, Tracking};

pub(super) use problem::Ready;

use crate::Result;
use crate::error::in_order;
use crate::simulate::{Simulator, State};
use backward::{Answer, Backward, KnotModel, backward, gradient};
use idle::{Idle, Lent};
use nalgebra::{DMatrix, DVector};
use problem::Run;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::time::Instant;
use trust::Trust;

/// Part of the expected fall of the cost that a step must bring.
const ARMIJO: f64 = 1e-4;
/// Trials that are made side by side once a whole step is refused. Fixed, so that what is found doesn't depend on the number of threads.
const BESIDE: usize = 3;
/// Part of the cost below which a fall is rounding.
const ROUNDING: f64 = 1e-14;

/// Seconds since the last call.
struct Watch(Instant);

impl Watch {
    fn lap(&mut self, into: &mut f64) {
        let now = Instant::now();
        *into += (now - self.0).as_secs_f64();
        self.0 = now;
    }
}

/// A trajectory, linearised.
struct Model {
    knots: Vec<KnotModel>,
    last: super::cost::Quadratic,
    gradient: f64,
    /// Controls whose slopes are those that they have elsewhere.
    lent: Vec<Lent>,
}

impl Model {
    fn of(ready: &Ready, run: &Run) -> Result<Self> {
        let (knots, last) = ready.models(run)?;
        let gradient = gradient(&knots, &last);
        // What no limit holds.
        let open = |(knot, g): (&KnotModel, &DVector<f64>)| {
            let entry = |i: usize| {
                let held =
                    (knot.lower[i] >= 0.0 && g[i] > 0.0) || (knot.upper[i] <= 0.0 && g[i] < 0.0);
                if held { 0.0 } else { g[i].abs() }
            };
            (0..g.len()).map(entry).fold(0.0, f64::max)
        };
        let gradient = knots.iter().zip(&gradient).map(open).fold(0.0, f64::max);
        Ok(Self {
            knots,
            last,
            gradient,
            lent: Vec::new(),
        })
    }

    /// The same, in which controls without a slope have the one that they have elsewhere.
    fn lent(ready: &Ready, run: &Run, idle: &Idle) -> Result<Self> {
        let mut out = Self::of(ready, run)?;
        out.lent = idle.lend(ready, run, &mut out.knots)?;
        Ok(out)
    }

    /// Takes the slopes that aren't its own back; whether there were any.
    fn is_taken_back(&mut self) -> bool {
        let any = !self.lent.is_empty();
        for lent in self.lent.drain(..) {
            lent.take_back(&mut self.knots);
        }
        any
    }
}

/// The longest step that lowers the cost as it should.
fn search(
    ready: &Ready,
    simulator: &Simulator,
    start: &State,
    run: &Run,
    sweep: &Backward,
    trials: usize,
) -> Result<Option<(f64, Run)>> {
    let try_out = |k: usize| -> Result<Option<(f64, Run)>> {
        let part = 0.5_f64.powi(k as i32);
        let found = match ready.trial(simulator, start, run, &sweep.answers, part) {
            Ok(found) => found,
            Err(stop) if stop.ends_search() => return Err(stop),
            Err(_) => return Ok(None),
        };
        let expected = part * (sweep.expected[0] + part * sweep.expected[1]);
        let falls = found.cost - run.cost <= ARMIJO * expected.min(0.0) && found.cost < run.cost;
        Ok(falls.then_some((part, found)))
    };
    // A whole step is what most iterations take.
    if let Some(found) = try_out(0)? {
        return Ok(Some(found));
    }
    let rest: Vec<usize> = (1..trials).collect();
    for few in rest.chunks(BESIDE) {
        let tried = in_order(few.par_iter().map(|k| try_out(*k)))?;
        if let Some(found) = tried.into_iter().flatten().next() {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// Controls that lower a problem's cost from a state on, from a guess. `progress` is called after every iteration and may end it; the plan so far is then what is found.
///
/// # Errors
/// A problem or settings that don't fit the simulator (limits the wrong way round, lists of wrong lengths, numbers that aren't finite, names that there aren't), a guess that can't be
/// simulated or whose cost isn't finite, and derivatives that can't be found. Trials that fail are shortened instead, but for what ends all: [`Error::Controller`](crate::Error::Controller) of a controller
/// or a cost, and [`Error::Stopped`](crate::Error::Stopped).
pub fn ilqr(
    simulator: &Simulator,
    start: &State,
    problem: &Problem,
    guess: Guess,
    settings: &IlqrSettings,
    mut progress: impl FnMut(&IlqrProgress) -> ControlFlow<()>,
) -> Result<Plan> {
    settings.validate()?;
    let ready = Ready::new(problem, simulator)?;
    solve(simulator, start, &ready, guess, settings, &mut progress)
}

/// The same with a problem that is ready.
pub(super) fn solve(
    simulator: &Simulator,
    start: &State,
    ready: &Ready,
    guess: Guess,
    settings: &IlqrSettings,
    progress: &mut dyn FnMut(&IlqrProgress) -> ControlFlow<()>,
) -> Result<Plan> {
    let (begun, mut times) = (Instant::now(), IlqrTimes::default());
    let mut watch = Watch(begun);
    let mut run = guess.run(ready, simulator, start)?;
    watch.lap(&mut times.rollouts);
    let idle = Idle::new(ready, &run)?;
    let mut model = Model::lent(ready, &run, &idle)?;
    watch.lap(&mut times.derivatives);
    let mut trust = Trust::new(settings);
    let mut costs = vec![run.cost];
    // Whether the model is this trajectory's, and whether all steps from here were refused so far.
    let (mut iterations, mut fresh, mut refused) = (0, true, false);
    let is_reached = |cost: f64| settings.target.is_some_and(|target| cost <= target);
    let mut answers;
    let stop = loop {
        if !fresh {
            model = Model::lent(ready, &run, &idle)?;
            fresh = true;
            watch.lap(&mut times.derivatives);
        }
        let sweep = loop {
            let made = backward(&model.knots, &model.last, trust.mu);
            if made.is_some() || trust.is_gone() {
                break made;
            }
            trust.grow();
        };
        watch.lap(&mut times.sweeps);
        let Some(sweep) = sweep else {
            answers = still(ready);
            break IlqrStop::Stuck;
        };
        answers = sweep.answers.clone();
        let expected = sweep.fall();
        let size = run.cost.abs();
        let least = settings.tolerance.max(ROUNDING) * size;
        if expected <= least {
            // Heavy regularisation makes any step small: what there is to gain tells a sweep without.
            let plain = || backward(&model.knots, &model.last, 0.0);
            if trust.mu == 0.0 || plain().is_some_and(|plain| plain.fall() <= least) {
                break IlqrStop::Stationary;
            }
            if refused {
                break IlqrStop::Stuck;
            }
        }
        if is_reached(run.cost) {
            break IlqrStop::Target;
        }
        if iterations == settings.iterations {
            break IlqrStop::Budget;
        }
        iterations += 1;
        let used = trust.mu;
        let found = search(ready, simulator, start, &run, &sweep, settings.trials)?;
        watch.lap(&mut times.rollouts);
        let (part, fell) = match found {
            Some((part, next)) => {
                let fell = run.cost - next.cost;
                (run, fresh, refused) = (next, false, false);
                trust.accepted(part, fell);
                (part, fell)
            }
            None => {
                if !model.is_taken_back() {
                    trust.refused();
                    refused = true;
                }
                (0.0, f64::INFINITY)
            }
        };
        costs.push(run.cost);
        let told = IlqrProgress {
            iteration: iterations,
            cost: run.cost,
            expected,
            part,
            regularisation: used,
            gradient: model.gradient,
        };
        if progress(&told).is_break() {
            break IlqrStop::Asked;
        }
        if part == 1.0 && used == 0.0 && fell <= settings.tolerance * size {
            break IlqrStop::Cost;
        }
        if trust.is_gone() {
            break IlqrStop::Stuck;
        }
        if iterations == settings.iterations && !settings.last_gains {
            break match is_reached(run.cost) {
                true => IlqrStop::Target,
                false => IlqrStop::Budget,
            };
        }
    };
    if !fresh && settings.last_gains {
        watch.lap(&mut times.rollouts);
        model = Model::lent(ready, &run, &idle)?;
        watch.lap(&mut times.derivatives);
        if let Some(sweep) = backward(&model.knots, &model.last, trust.mu) {
            answers = sweep.answers;
        }
        watch.lap(&mut times.sweeps);
    }
    times.total = begun.elapsed().as_secs_f64();
    Ok(Plan {
        tracking: plan::track(simulator, ready, &run, &answers),
        controls: run.controls,
        rollout: run.rollout,
        gains: answers.iter().map(|a| a.gain.clone()).collect(),
        steps: answers.into_iter().map(|a| a.step).collect(),
        costs,
        gradient: model.gradient,
        regularisation: trust.mu,
        iterations,
        stop,
        times,
    })
}

/// No step and no feedback.
fn still(ready: &Ready) -> Vec<Answer> {
    let (nu, nx) = (ready.cost.sizes.controls, ready.cost.sizes.states());
    let one = Answer {
        step: DVector::zeros(nu),
        gain: DMatrix::zeros(nu, nx),
        of_previous: None,
        held: vec![false; nu],
    };
    vec![one; ready.knots]
}
