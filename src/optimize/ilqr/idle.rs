//! Controls that have no slope where they are, and act farther off.
//!
//! The thrust of a propeller goes with u |u|, and some has a dead band: at u = 0, where a plan without a guess begins, its slope is zero, and by the model nothing that it does changes
//! anything. So it is nearly where it is next to that. Such a control lends its knot the slope that it has away from there. It is no derivative of the trajectory; whether a step helps is found by taking it, as ever.

use super::backward::KnotModel;
use super::problem::{Ready, Run, chained};
use crate::Result;
use crate::error::in_order;
use crate::simulate::Controls;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// How far off a control's slope is looked for, as a part of what its limits leave it.
const AWAY: f64 = 0.5;
/// Part of the slope that a control has there up to which it counts as having none.
const LITTLE: f64 = 1e-9;

/// The slopes of a search's controls away from where it begins, by which one that has next to none is told: the length of each control's, at the first knot.
pub(super) struct Idle(Vec<f64>);

/// A control of a knot whose slope isn't its own, and that.
pub(super) struct Lent {
    knot: usize,
    control: usize,
    own: DVector<f64>,
}

impl Lent {
    /// Gives the knot its own back.
    pub fn take_back(self, knots: &mut [KnotModel]) {
        knots[self.knot].b.set_column(self.control, &self.own);
    }
}

impl Idle {
    /// Of the trajectory that a search begins with. Where it can't be found, only what changes nothing at all has no slope.
    ///
    /// # Errors
    /// What ends a search.
    pub fn new(ready: &Ready, run: &Run) -> Result<Self> {
        let control = run.controls.column(0).into_owned();
        let size = size(run);
        let moved = DVector::from_fn(control.len(), |i, _| {
            let room = [ready.lower[i] - control[i], ready.upper[i] - control[i]];
            control[i] + away(room, size)
        });
        match slopes(ready, run, 0, &moved) {
            Ok(slopes) => Ok(Self(slopes.column_iter().map(|b| b.norm()).collect())),
            Err(stop) if stop.ends_search() => Err(stop),
            Err(_) => Ok(Self(vec![0.0; control.len()])),
        }
    }

    /// Gives controls that have no slope where they are the one that they have away from there, all of a knot at once; those that have one.
    ///
    /// # Errors
    /// What ends a search. A knot that can't be simulated so keeps what it has.
    pub fn lend(&self, ready: &Ready, run: &Run, knots: &mut [KnotModel]) -> Result<Vec<Lent>> {
        let size = size(run);
        let each = knots.par_iter_mut().enumerate().map(|(k, knot)| {
            let found = self.of(knot, size);
            if found.is_empty() {
                return Ok(Vec::new());
            }
            let mut control = run.controls.column(k).into_owned();
            for (i, far) in &found {
                control[*i] += far;
            }
            let slopes = match slopes(ready, run, k, &control) {
                Ok(slopes) => slopes,
                Err(stop) if stop.ends_search() => return Err(stop),
                Err(_) => return Ok(Vec::new()),
            };
            let acts = |i: &usize| slopes.column(*i).amax() > 0.0;
            let lent = found.iter().map(|(i, _)| *i).filter(acts);
            let lend = |i: usize| {
                let own = knot.b.column(i).into_owned();
                knot.b.set_column(i, &slopes.column(i));
                Lent {
                    knot: k,
                    control: i,
                    own,
                }
            };
            Ok(lent.map(lend).collect())
        });
        Ok(in_order(each)?.into_iter().flatten().collect())
    }

    /// Controls of a knot that change next to nothing, and that limits let change, with how far off to look.
    fn of(&self, knot: &KnotModel, size: f64) -> Vec<(usize, f64)> {
        let still = |i: &usize| knot.b.column(*i).norm() <= LITTLE * self.0[*i];
        let far = |i: usize| (i, away([knot.lower[i], knot.upper[i]], size));
        let all = (0..knot.b.ncols()).filter(still).map(far);
        all.filter(|(_, far)| *far != 0.0).collect()
    }
}

/// How far off to look, from what limits leave below and above; where they leave all, `size`.
fn away([below, above]: [f64; 2], size: f64) -> f64 {
    let room = if above >= -below { above } else { below };
    match room.is_finite() {
        true => AWAY * room,
        false => size.copysign(room),
    }
}

/// Of forces and speeds without limits the plan's own tell the size.
fn size(run: &Run) -> f64 {
    let most = run.controls.amax();
    if most > 0.0 { most } else { 1.0 }
}

/// How a knot's next state changes with its controls, from the knot's state on with these.
fn slopes(ready: &Ready, run: &Run, knot: usize, control: &DVector<f64>) -> Result<DMatrix<f64>> {
    let (rollout, simulator) = (&run.rollout, run.rollout.simulator());
    let columns = vec![control.clone(); ready.hold];
    let controls = Controls::from_matrix(simulator, DMatrix::from_columns(&columns))?;
    let state = &rollout.states()[knot * ready.hold];
    let made = simulator.rollout_from(state, &controls, |_| ControlFlow::Continue(()))?;
    Ok(chained(&made.step_jacobians(&[])?).1)
}
