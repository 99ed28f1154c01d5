//! Model-predictive control of a simulated plant.

use super::{Mpc, Replan, check_plant};
use crate::optimize::cost::{Cost, CostPoint, Sizes};
use crate::simulate::{Rollout, Simulator, State, steps_at};
use crate::{Error, Result};
use std::ops::ControlFlow;

/// State of a run after a step of the plant.
#[derive(Clone, Debug, PartialEq)]
pub struct MpcProgress {
    /// Steps of the plant made.
    pub step: usize,
    /// Steps that it is to make.
    pub steps: usize,
    /// Plans made.
    pub replans: usize,
    /// The last of them; one of an earlier run where this one goes on from it.
    pub last: Option<Replan>,
}

/// What became of a plant.
pub struct MpcRun {
    /// Its trajectory; the controls are those that were applied.
    pub rollout: Rollout,
    /// The running cost at each of its states but the last, as a rate (1/s); changes of controls are those since a knot's time before.
    pub rates: Vec<f64>,
    /// Their integral over time, with the last terms at the end.
    pub cost: f64,
    /// The plans that were made for it.
    pub replans: Vec<Replan>,
}

impl MpcRun {
    /// Seconds of the plans after the first one: mean and longest; none where there was only one.
    pub fn plan_seconds(&self) -> Option<(f64, f64)> {
        let times = self.replans.iter().skip(1).map(|r| r.seconds);
        let count = times.clone().count();
        let longest = times.clone().fold(0.0, f64::max);
        (count > 0).then(|| (times.sum::<f64>() / count as f64, longest))
    }
}

impl Mpc {
    /// Runs a plant for so many of its time steps, from a state of it; on from the plans so far if all of them are of times before, or it starts where the last run ended. Its cost is that of `cost`, read on the plant: as a rule the problem's.
    /// `progress` is called before every step and may end the run.
    ///
    /// # Errors
    /// A plant with other numbers of coordinates, velocities or controls than the model, a step of it that fails, whatever [`Mpc::control`] reports, and [`Error::Stopped`] if
    /// `progress` breaks.
    pub fn run(
        &mut self,
        plant: &Simulator,
        start: &State,
        steps: usize,
        cost: &Cost,
        mut progress: impl FnMut(&MpcProgress) -> ControlFlow<()> + Send,
    ) -> Result<MpcRun> {
        check_plant(Sizes::of(plant), self.ready.cost.sizes)?;
        let bound = cost.bind(plant)?;
        let time = start.step as f64 * plant.time_step();
        let goes_on = self.ended.take() == Some((start.clone(), plant.time_step()));
        let decided = self.held.as_ref().map(|(step, _)| *step);
        let decided = decided.max(self.plan.as_ref().map(|(step, _)| *step));
        let now = steps_at(time - self.start, self.model.time_step());
        // What was decided at that time was for another state.
        if !goes_on && decided.is_some_and(|step| now <= step as f64) {
            self.reset();
        }
        let held = self.held.as_ref().map(|(_, control)| control.clone());
        let first = held.or_else(|| self.previous.clone());
        let before = self.replans.len();
        let rollout = plant.rollout_deciding(start, steps, |n, sample| {
            let told = MpcProgress {
                step: n,
                steps,
                replans: self.replans.len() - before,
                last: self.replans.last().cloned(),
            };
            if progress(&told).is_break() {
                return Err(Error::Stopped {
                    what: format!("model-predictive control, after {n} of {steps} steps"),
                });
            }
            self.control(sample.time, &sample.q, &sample.v)
        })?;
        let columns: Vec<_> = rollout
            .controls()
            .column_iter()
            .map(|c| c.into_owned())
            .collect();
        let dt = plant.time_step();
        // Controls change from knot to knot of a plan, which may last many steps of the plant.
        let knot = (steps_at(self.ready.duration, dt) as usize).max(1);
        let at = |n: usize| CostPoint {
            rollout: &rollout,
            state: n,
            knot: n,
            control: columns.get(n),
            previous: match n.checked_sub(knot) {
                Some(before) => columns.get(before),
                None => first.as_ref(),
            },
        };
        let rates = (0..steps).map(|n| bound.value(&at(n), 1.0));
        let rates = rates.collect::<Result<Vec<f64>>>()?;
        let last = bound.value(&at(steps), 1.0)?;
        self.ended = rollout.states().last().map(|end| (end.clone(), dt));
        Ok(MpcRun {
            cost: dt * rates.iter().sum::<f64>() + last,
            rates,
            replans: self.replans[before..].to_vec(),
            rollout,
        })
    }
}
