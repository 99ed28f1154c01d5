//! Steps whose open-loop controls are decided as the run goes.

use super::Sample;
use super::trajectory::{Partial, Seed, Trajectory};
use crate::adjoint::step::Step;
use crate::dynamics::{State, StateBar, StepRecord};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;

/// A trajectory's steps, each with the controls that `decide` gives it.
pub(super) struct Deciding<'a, F> {
    trajectory: Trajectory<'a>,
    decide: RefCell<F>,
    made: RefCell<Vec<DVector<f64>>>,
}

impl<'a, F: FnMut(usize, &Sample) -> Result<DVector<f64>>> Deciding<'a, F> {
    pub fn new(trajectory: Trajectory<'a>, decide: F) -> Self {
        Self {
            trajectory,
            decide: RefCell::new(decide),
            made: RefCell::new(Vec::new()),
        }
    }

    /// What was decided, controls × steps.
    pub fn made(self) -> DMatrix<f64> {
        let controls = self.trajectory.controls.nrows();
        let made = self.made.into_inner();
        DMatrix::from_fn(controls, made.len(), |i, n| made[n][i])
    }
}

impl<F: FnMut(usize, &Sample) -> Result<DVector<f64>>> Step for Deciding<'_, F> {
    type State = State;
    type Observation = Sample;
    type Record = StepRecord;
    type Cotangent = StateBar;
    type Seed = Seed;
    type Partial = Partial;
    type Error = Error;

    fn step(&self, index: usize, state: &State) -> Result<(State, Sample, StepRecord)> {
        self.trajectory.advance(state, |sample| {
            let control = (self.decide.borrow_mut())(index, sample)?;
            let expected = self.trajectory.controls.nrows();
            if control.len() != expected {
                return Err(Error::input(
                    format!("controls decided for step {index}"),
                    format!("{} numbers", control.len()),
                    format!("must be {expected} numbers, one per control"),
                ));
            }
            self.made.borrow_mut().push(control.clone());
            Ok(control)
        })
    }

    fn last(&self, index: usize, state: &State) -> Result<Sample> {
        self.trajectory.last(index, state)
    }

    fn step_vjp(
        &self,
        index: usize,
        record: &StepRecord,
        next_bar: &StateBar,
        seed: &Seed,
    ) -> Result<(StateBar, Partial)> {
        self.trajectory.step_vjp(index, record, next_bar, seed)
    }

    fn last_vjp(
        &self,
        index: usize,
        state: &State,
        sample: &Sample,
        seed: &Seed,
    ) -> Result<(StateBar, Partial)> {
        self.trajectory.last_vjp(index, state, sample, seed)
    }
}
