//! Controls that have no slope where they are, and act farther off.
//!
//! The thrust of a propeller goes with u |u|, and some has a dead band: at u = 0, where a plan without a guess begins, its slope is zero, and by the model nothing that it does changes
//! anything. Such a control lends its knot the slope that it has away from there. It is no derivative of the trajectory; whether a step helps is found by taking it, as ever.

use super::backward::KnotModel;
use super::problem::{Ready, Run, chained};
use crate::Result;
use crate::error::in_order;
use crate::simulate::{Controls, Rollout, Simulator};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// How far off a control's slope is looked for, as a part of what its limits leave it.
const AWAY: f64 = 0.5;

/// Controls of a knot that change no state, and that limits let change, with how far off to look.
fn idle(knot: &KnotModel, unlimited: f64) -> Vec<(usize, f64)> {
    let still = |i: &usize| knot.b.column(*i).iter().all(|x| *x == 0.0);
    let away = |i: usize| {
        let (below, above) = (knot.lower[i], knot.upper[i]);
        let room = if above >= -below { above } else { below };
        let far = if room.is_finite() {
            AWAY * room
        } else {
            unlimited.copysign(room)
        };
        (far != 0.0).then_some((i, far))
    };
    (0..knot.b.ncols()).filter(still).filter_map(away).collect()
}

/// Gives controls that have no slope where they are the one that they have away from there, all of a knot at once; which have one, by knot and control.
///
/// # Errors
/// What ends a search. A knot that can't be simulated so keeps what it has.
pub(super) fn lend(
    ready: &Ready,
    run: &Run,
    knots: &mut [KnotModel],
) -> Result<Vec<(usize, usize)>> {
    // Of forces and speeds without limits the plan's own tell the size.
    let unlimited = run.controls.amax();
    let unlimited = if unlimited > 0.0 { unlimited } else { 1.0 };
    let simulator = run.rollout.simulator();
    let each = knots.par_iter_mut().enumerate().map(|(k, knot)| {
        let found = idle(knot, unlimited);
        if found.is_empty() {
            return Ok(Vec::new());
        }
        let mut control = run.controls.column(k).into_owned();
        for (i, away) in &found {
            control[*i] += away;
        }
        let made = slopes(ready, simulator, &run.rollout, k, &control);
        let slopes = match made {
            Ok(slopes) => slopes,
            Err(stop) if stop.ends_search() => return Err(stop),
            Err(_) => return Ok(Vec::new()),
        };
        let lent = found.iter().map(|(i, _)| *i);
        let lent = lent.filter(|i| slopes.column(*i).amax() > 0.0);
        let lent: Vec<_> = lent.map(|i| (k, i)).collect();
        for (_, i) in &lent {
            knot.b.set_column(*i, &slopes.column(*i));
        }
        Ok(lent)
    });
    Ok(in_order(each)?.concat())
}

/// How a knot's next state changes with its controls, from the knot's state on with these.
fn slopes(
    ready: &Ready,
    simulator: &Simulator,
    rollout: &Rollout,
    knot: usize,
    control: &DVector<f64>,
) -> Result<DMatrix<f64>> {
    let columns = vec![control.clone(); ready.hold];
    let controls = Controls::from_matrix(simulator, DMatrix::from_columns(&columns))?;
    let state = &rollout.states()[knot * ready.hold];
    let made = simulator.rollout_from(state, &controls, |_| ControlFlow::Continue(()))?;
    Ok(chained(&made.step_jacobians(&[])?).1)
}
