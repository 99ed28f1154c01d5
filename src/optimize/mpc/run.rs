//! Model-predictive control of a simulated plant.

use super::{Mpc, Replan, check_plant};
use crate::optimize::cost::{Cost, CostPoint, Sizes};
use crate::simulate::{Rollout, Simulator, State};
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
    /// The running cost at each of its states but the last, as a rate (1/s).
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
    /// Runs a plant for so many of its time steps, from a state of it; on from the plans so far unless they are of a later time. Its cost is that of `cost`, read on the plant: as a rule the problem's.
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
        if self
            .held
            .as_ref()
            .is_some_and(|(step, _)| self.time_of(*step) > time)
        {
            self.reset();
        }
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
        let at = |n: usize| CostPoint {
            rollout: &rollout,
            state: n,
            knot: n,
            control: columns.get(n),
            previous: n.checked_sub(1).and_then(|n| columns.get(n)),
        };
        let rates = (0..steps).map(|n| bound.value(&at(n), 1.0));
        let rates = rates.collect::<Result<Vec<f64>>>()?;
        let last = bound.value(&at(steps), 1.0)?;
        Ok(MpcRun {
            cost: dt * rates.iter().sum::<f64>() + last,
            rates,
            replans: self.replans[before..].to_vec(),
            rollout,
        })
    }
}
