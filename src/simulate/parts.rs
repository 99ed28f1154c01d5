//! Gradients of runs that are too long to be kept: a part of the run at a time, run again from states that are kept ([`revolve`]).
//!
//! A [`Rollout`] keeps some kilobytes a step, which its gradient needs. Here only one part of the run is kept so, and a number of states, of a few hundred bytes each; the
//! price is that parts run again. With as many states as parts each part but the last runs twice; with few states more often, by the binomial coefficients. The gradient
//! is that of the whole [`Rollout`], to the bit.

use super::gradient::Sums;
use super::part::{Part, Partwise};
use super::{Controls, Gradient, Rollout, Simulator};
use crate::adjoint::revolve::{advances, revolve};
use crate::dynamics::{State, StateBar};
use crate::{Error, Result};
use std::ops::ControlFlow;

/// Fewest states that a limit of memory must have room for.
pub const LEAST_STATES: usize = 4;

/// What is kept of a long run at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checkpoints {
    /// Steps of a part, of which all is kept.
    pub part: usize,
    /// States kept, that at the start among them.
    pub states: usize,
}

impl Checkpoints {
    /// Parts of about the square root of the steps, and a state for each: all but the last part run twice.
    pub fn new(steps: usize) -> Self {
        let part = (steps as f64).sqrt().ceil().max(1.0) as usize;
        Self {
            part,
            states: steps.div_ceil(part).max(1),
        }
    }

    /// The fewest steps made again within `bytes` of memory, half of them for the part and half for the states.
    ///
    /// # Errors
    /// Too few for a step and [`LEAST_STATES`] states: with one state every part would begin at the start again.
    pub fn within(simulator: &Simulator, steps: usize, bytes: f64) -> Result<Self> {
        let tree = &simulator.system().tree;
        let numbers = tree.coordinates() + tree.velocities() + simulator.system().len();
        let of_step = simulator.step_bytes();
        let of_state = 200.0 + 8.0 * numbers as f64;
        let least = 2.0 * of_step.max(LEAST_STATES as f64 * of_state);
        if !(bytes >= least && bytes.is_finite()) {
            return Err(Error::input(
                "memory of a gradient in parts",
                format!("{bytes} bytes"),
                format!(
                    "must be at least {:.0} for a scene of this size",
                    least.ceil()
                ),
            ));
        }
        let count = |size: f64| (0.5 * bytes / size) as usize;
        let part = count(of_step).clamp(1, steps.max(1));
        let parts = steps.div_ceil(part).max(1);
        Ok(Self {
            part,
            states: count(of_state).clamp(1, parts),
        })
    }

    /// Parts of a run of `steps` steps, the last one perhaps shorter.
    fn parts(&self, steps: usize) -> usize {
        steps.div_ceil(self.part.max(1)).max(1)
    }

    /// Work of a gradient of `steps` steps, as its progress counts it: parts run, and parts gone back through, twice each.
    pub fn work(&self, steps: usize) -> usize {
        let parts = self.parts(steps);
        advances(parts, self.states.max(1)) + 2 * parts
    }
}

/// The gradient of a long run.
#[derive(Clone, Debug)]
pub struct InParts {
    /// Value of the objective.
    pub value: f64,
    /// Its gradient.
    pub gradient: Gradient,
    /// Steps made in all, forward; those of the run itself and those made again.
    pub made: usize,
}

impl Simulator {
    /// Value and gradient of an objective of a run, with no more of it kept at a time than `kept` says. `progress` is called with how much of [`Checkpoints::work`] is done, and
    /// may end it.
    ///
    /// # Errors
    /// As [`Simulator::rollout`] and [`Rollout::gradient`], parts of no steps, and [`Error::Stopped`] if `progress` breaks.
    pub fn gradient_in_parts(
        &self,
        controls: &Controls,
        objective: &dyn Partwise,
        kept: Checkpoints,
        mut progress: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<InParts> {
        if kept.part == 0 || kept.states == 0 {
            return Err(Error::input(
                "checkpoints",
                format!("{kept:?}"),
                "a part must have a step at least, and a state must be kept",
            ));
        }
        let steps = controls.steps();
        let (parts, all) = (kept.parts(steps), kept.work(steps));
        let run = Run {
            simulator: self,
            controls,
            part: kept.part,
        };
        let mut done = 0;
        let mut on = |by: usize| {
            done += by;
            match progress(done) {
                ControlFlow::Continue(()) => Ok(()),
                ControlFlow::Break(()) => Err(Error::Stopped {
                    what: format!("the gradient, after {done} of {all} parts"),
                }),
            }
        };
        let on = std::cell::RefCell::new(&mut on);
        let initial = self.initial().map_err(|e| e.at_time(0.0))?;
        let made = std::cell::Cell::new(0);
        let mut sums = Sums::new(self, controls.matrix().shape());
        let (mut value, mut bar) = (0.0, None);
        let mut advance = |k: usize, state: &State| {
            let rollout = run.part(k, state)?;
            made.set(made.get() + rollout.steps());
            (on.borrow_mut())(1)?;
            Ok(rollout.states()[rollout.steps()].clone())
        };
        let mut reverse = |k: usize, state: &State| {
            let rollout = run.part(k, state)?;
            made.set(made.get() + rollout.steps());
            let part = Part {
                rollout: &rollout,
                first: k * kept.part,
                steps,
            };
            let (own, cotangents) = objective.part(&part)?;
            value += own;
            let end: Option<StateBar> = bar.take();
            let before = rollout.back(end, &cotangents, part.first, &mut sums, |_| Ok(()))?;
            if k == 0 {
                let v = self.start().1;
                sums.start(self, state, v, &before)?;
            }
            bar = Some(before);
            (on.borrow_mut())(2)
        };
        revolve(parts, kept.states, initial, &mut advance, &mut reverse)?;
        Ok(InParts {
            value,
            gradient: sums.gradient,
            made: made.get(),
        })
    }
}

/// A long run.
struct Run<'s> {
    simulator: &'s Simulator,
    controls: &'s Controls,
    part: usize,
}

impl Run<'_> {
    /// Part `k` from the state at its start.
    fn part(&self, k: usize, state: &State) -> Result<Rollout> {
        let matrix = self.controls.matrix();
        let first = k * self.part;
        let count = self.part.min(matrix.ncols() - first);
        let own = matrix.columns(first, count).into_owned();
        let own = Controls::from_matrix(self.simulator, own)?;
        let go_on = |_| ControlFlow::Continue(());
        self.simulator.rollout_from(state, &own, go_on)
    }
}
