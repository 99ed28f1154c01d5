//! Observables that are gains over a step, by its length: from which states they are read, and the transpose of that.

use super::Rollout;
use super::observable::{Differentiable, differentiable, without_steps};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::borrow::Cow;

/// From which states an observable is read.
#[derive(Clone, Copy)]
pub(super) enum Reads {
    /// From the state alone.
    State,
    /// From the ends of the step that starts there, or of the last one: their difference by the step's length.
    Step {
        /// Steps of the rollout, one at least.
        steps: usize,
        /// Per second.
        rate: f64,
    },
}

impl Rollout {
    /// From which states an observable of this name is read.
    ///
    /// # Errors
    /// A gain where there is no step.
    pub(super) fn reads(&self, name: &str, observable: &dyn Differentiable) -> Result<Reads> {
        match (observable.is_gain(), self.steps()) {
            (false, _) => Ok(Reads::State),
            (true, 0) => Err(without_steps(name)),
            (true, steps) => Ok(Reads::Step {
                steps,
                rate: 1.0 / self.simulator().time_step(),
            }),
        }
    }

    /// Refuses observables over steps where a trajectory is gone through in parts.
    pub(super) fn refuse_gains<'n>(&self, names: impl Iterator<Item = &'n String>) -> Result<()> {
        for name in names {
            if differentiable(name)?.is_gain() {
                return Err(Error::Unsupported {
                    what: format!("the gradient in parts of the observable {name:?}"),
                    why: "it is a mean over a step, which parts have in common".into(),
                    instead:
                        "take the gradient of the whole rollout, or an objective of velocities"
                            .into(),
                });
            }
        }
        Ok(())
    }

    /// The samples at the ends of the step that starts at state `n`, or of the last one; none of a rollout without steps.
    pub(super) fn step_around(&self, n: usize) -> Option<[&super::Sample; 2]> {
        let first = n.min(self.steps().checked_sub(1)?);
        let samples = self.samples();
        Some([&samples[first], &samples[first + 1]])
    }
}

impl Reads {
    /// The states that it is read from at state `n`, each with its weight.
    pub fn at(self, n: usize) -> Vec<(usize, f64)> {
        match self {
            Self::State => vec![(n, 1.0)],
            Self::Step { steps, rate } => {
                let first = n.min(steps - 1);
                vec![(first, -rate), (first + 1, rate)]
            }
        }
    }

    /// The observable at all states, a column each, from what it is read from.
    pub fn apply(self, read: DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::State => read,
            Self::Step { .. } => {
                let mut out = DMatrix::zeros(read.nrows(), read.ncols());
                for (n, mut column) in out.column_iter_mut().enumerate() {
                    for (state, weight) in self.at(n) {
                        column.axpy(weight, &read.column(state), 1.0);
                    }
                }
                out
            }
        }
    }

    /// Transpose of [`Reads::apply`].
    pub fn apply_vjp(self, bar: &DMatrix<f64>) -> Cow<'_, DMatrix<f64>> {
        match self {
            Self::State => Cow::Borrowed(bar),
            Self::Step { .. } => {
                let mut out = DMatrix::zeros(bar.nrows(), bar.ncols());
                for (n, column) in bar.column_iter().enumerate() {
                    for (state, weight) in self.at(n) {
                        out.column_mut(state).axpy(weight, &column, 1.0);
                    }
                }
                Cow::Owned(out)
            }
        }
    }
}
