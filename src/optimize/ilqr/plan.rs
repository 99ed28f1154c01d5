//! Where iLQR ended, and where it starts.

use super::problem::{Ready, Run, moved};
use super::tracking::{Track, Tracking};
use super::{Answer, IlqrStop, IlqrTimes};
use crate::simulate::{Rollout, Simulator, State};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Where to start from. Controls outside the limits are moved to them.
#[derive(Clone, Copy, Default)]
pub enum Guess<'a> {
    /// No control.
    #[default]
    Zero,
    /// These, controls × knots.
    Controls(&'a DMatrix<f64>),
    /// A plan that was made before, with its feedback or without, whichever costs less: from the trajectory's first state on it is `shift` time steps on its way. Past its end its last controls are held.
    Plan {
        /// The plan ([`Plan::tracking`]).
        plan: &'a Tracking,
        /// Time steps.
        shift: usize,
    },
}

/// Controls over a horizon, the trajectory that they make, and the feedback about it.
pub struct Plan {
    /// Controls × knots.
    pub controls: DMatrix<f64>,
    /// The trajectory.
    pub rollout: Rollout,
    /// K of each knot, controls × 2nv: how its controls best answer to a change of its state, (q, v) with q in its tangent space. Rows of controls that a limit holds are zero.
    pub gains: Vec<DMatrix<f64>>,
    /// k of each knot: the step by which the last model would change the controls.
    pub steps: Vec<DVector<f64>>,
    /// Cost of the start and after every iteration.
    pub costs: Vec<f64>,
    /// Largest entry of the gradient by the controls, where no limit holds them, of the trajectory to which `gains` belong.
    pub gradient: f64,
    /// Regularisation of the last model.
    pub regularisation: f64,
    /// Iterations made.
    pub iterations: usize,
    /// Why it ended.
    pub stop: IlqrStop,
    /// Where the time went.
    pub times: IlqrTimes,
    pub(super) tracking: Tracking,
}

impl Plan {
    /// Cost of the trajectory.
    pub fn cost(&self) -> f64 {
        self.costs[self.costs.len() - 1]
    }

    /// Iterations a second.
    pub fn rate(&self) -> f64 {
        self.iterations as f64 / self.times.total
    }

    /// The feedback that holds a robot to it.
    pub fn tracking(&self) -> Tracking {
        self.tracking.clone()
    }
}

/// The feedback about a run.
pub(super) fn track(
    simulator: &Simulator,
    ready: &Ready,
    run: &Run,
    answers: &[Answer],
) -> Tracking {
    let samples = run.rollout.samples();
    Tracking(Arc::new(Track {
        simulator: simulator.clone(),
        start: samples[0].time,
        hold: ready.hold,
        states: samples.iter().map(|s| (s.q.clone(), s.v.clone())).collect(),
        controls: run.controls.clone(),
        gains: answers.iter().map(|a| a.gain.clone()).collect(),
        lower: ready.lower.clone(),
        upper: ready.upper.clone(),
    }))
}

/// A run, none where it failed.
fn possible(made: Result<Run>) -> Result<Option<Run>> {
    match made {
        Ok(run) => Ok(Some(run)),
        Err(e) if e.ends_search() => Err(e),
        Err(_) => Ok(None),
    }
}

impl Guess<'_> {
    /// The trajectory to start from.
    pub(super) fn run(&self, ready: &Ready, simulator: &Simulator, start: &State) -> Result<Run> {
        let sizes = ready.cost.sizes;
        match self {
            Self::Zero => {
                let zero = DVector::zeros(sizes.controls);
                ready.run(simulator, start, |_, _, _, _| zero.clone())
            }
            Self::Controls(given) => {
                let right = (sizes.controls, ready.knots);
                if given.shape() != right || given.iter().any(|x| !x.is_finite()) {
                    let what = match given.shape() == right {
                        true => "an entry that isn't finite".into(),
                        false => format!("{} × {}", given.nrows(), given.ncols()),
                    };
                    return Err(Error::input(
                        "guess: controls",
                        what,
                        format!(
                            "must be {} × {}, controls × knots, of finite numbers",
                            right.0, right.1
                        ),
                    ));
                }
                ready.run(simulator, start, |k, _, _, _| given.column(k).into_owned())
            }
            Self::Plan { plan, shift } => {
                let track = &*plan.0;
                let [nu, nx] = [track.controls.nrows(), track.gains[0].ncols()];
                if [nu, nx] != [sizes.controls, sizes.states()] {
                    return Err(Error::input(
                        "guess: plan",
                        format!("{nu} controls and {nx} numbers of a state"),
                        format!(
                            "must be one of {} controls and {}",
                            sizes.controls,
                            sizes.states()
                        ),
                    ));
                }
                let step = |k: usize| k * ready.hold + shift;
                let with_feedback =
                    |k: usize, q: &DVector<f64>, v: &DVector<f64>, _: Option<&DVector<f64>>| {
                        let at = step(k) as isize;
                        plan.before_limits(at, q, v).0
                    };
                // Far from the plan its feedback may do harm; then its controls, then none.
                let alone =
                    |k: usize, _: &DVector<f64>, _: &DVector<f64>, _: Option<&DVector<f64>>| {
                        plan.planned(step(k))
                    };
                let (followed, alone) = rayon::join(
                    || ready.run(simulator, start, with_feedback),
                    || ready.run(simulator, start, alone),
                );
                match (possible(followed)?, possible(alone)?) {
                    (Some(followed), Some(alone)) if alone.cost < followed.cost => Ok(alone),
                    (Some(run), _) | (None, Some(run)) => Ok(run),
                    (None, None) => Guess::Zero.run(ready, simulator, start),
                }
            }
        }
    }
}

impl Ready {
    /// The trajectory of a part of a step.
    pub(super) fn trial(
        &self,
        simulator: &Simulator,
        start: &State,
        from: &Run,
        answers: &[Answer],
        part: f64,
    ) -> Result<Run> {
        let samples = from.rollout.samples();
        self.run(simulator, start, |k, q, v, previous| {
            let at = &samples[k * self.hold];
            let moved = moved(simulator, (&at.q, &at.v), (q, v));
            self.answered(k, from, &answers[k], part, &moved, previous)
        })
    }
}
