//! How much a trajectory magnifies a small change of its state, and with it the gradient.
//!
//! With x = (q, v), the free coordinates in their tangent space, the Jacobian of step n is A_n = ∂x_{n+1}/∂x_n, and a change of the start
//! becomes A_{N−1} … A_0 times it at the end. The integrator's own state is (q, y), so that
//!
//! ```text
//! A_n = T_{n+1} B_n T_n⁻¹      B_n = ∂(q, y)_{n+1}/∂(q, y)_n      T_n = ∂(q, v)_n/∂(q, y)_n
//! ```
//!
//! B_n and T_n come row by row from the transposes that the gradient is made of, T_n⁻¹ from that of y(q, v). Singular values are
//! taken in comparable units: displacements in units of the cube root of the largest body's volume (angles in radians), velocities in
//! the same units per duration of the trajectory. A free body without forces then grows by 1.6, whatever its size and time.

use super::gradcheck::unit_displacements;
use super::trajectory::{ControlledStep, Seed, Trajectory};
use super::{Controls, Sample, Simulator};
use crate::dynamics::{Linearisation, State, StateBar, StepBar};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

/// Growth above which gradients are hard to use: a relative error of a thousandth becomes one of a tenth.
const LARGE: f64 = 100.0;

/// A growth factor, and where it is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Peak {
    /// Largest singular value.
    pub factor: f64,
    /// Number of the step, or of the state.
    pub step: usize,
    /// Its time, s.
    pub time: f64,
}

impl Peak {
    fn raise(&mut self, factor: f64, step: usize, time: f64) {
        if factor > self.factor {
            *self = Self { factor, step, time };
        }
    }
}

/// How a trajectory magnifies changes of its state.
#[derive(Clone, Debug, Serialize)]
pub struct Growth {
    /// Largest singular value of the Jacobian of a single step, and which step.
    pub largest_step: Peak,
    /// Largest singular value of the product over the whole trajectory: a change of the start grows by at most this much. At most
    /// the largest number there is.
    pub total: f64,
    /// The largest of that over all states, and which state.
    pub peak: Peak,
    /// Duration of the trajectory, s.
    pub duration: f64,
    /// The product's largest singular value at states 0 … N.
    #[serde(skip)]
    pub course: Vec<f64>,
}

impl Growth {
    /// What to do where the growth is large.
    pub fn advice(&self) -> Option<String> {
        (self.peak.factor > LARGE).then(|| {
            format!(
                "changes grow by {:.1e} by t = {} s, and gradients with them: clip the gradient, optimise over a shorter \
                 horizon, or split the trajectory into several with matching states (multiple shooting)",
                self.peak.factor, self.peak.time
            )
        })
    }
}

/// The growth along the trajectory of the scene's own controller over `steps` steps.
///
/// # Errors
/// A rollout or a transpose that fails, or no steps.
pub fn growth(simulator: &Simulator, steps: usize) -> Result<Growth> {
    if steps == 0 {
        return Err(Error::input("growth: steps", steps, "must be at least 1"));
    }
    let zero = Controls::zeros(simulator, steps);
    let rollout = simulator.rollout(&zero)?;
    let trajectory = simulator.trajectory(zero.matrix());
    let duration = simulator.time_step() * steps as f64;
    let system = simulator.system();
    let nv = system.tree.velocities();
    let displacement = unit_displacements(simulator).0;
    let unit = DVector::from_fn(2 * nv, |i, _| {
        displacement[i % nv.max(1)] / if i < nv { 1.0 } else { duration }
    });
    let mut out = Growth {
        largest_step: Peak::default(),
        total: 1.0,
        peak: Peak {
            factor: 1.0,
            ..Peak::default()
        },
        duration,
        course: vec![1.0],
    };
    if nv == 0 {
        out.course = vec![1.0; steps + 1];
        return Ok(out);
    }
    // The product so far, as e^size times a matrix whose entries are of order one.
    let (mut product, mut size) = (DMatrix::<f64>::identity(2 * nv, 2 * nv), 0.0);
    let (states, samples) = (rollout.states(), rollout.samples());
    let records = rollout.tape.records();
    let last = trajectory.stepper.linearise(&states[steps].q)?;
    let linearise = |n: usize| records.get(n).map(|r| trajectory.linearise(r)).transpose();
    let mut now = linearise(0)?;
    for n in 0..steps {
        let next = linearise(n + 1)?;
        let Some(step) = &now else { break };
        let e = step.linearisation();
        let from = from_velocity(&trajectory, e, &states[n], &samples[n])?;
        let through = through(step, nv)?;
        let e = next.as_ref().map_or(&last, |next| next.linearisation());
        let to = to_velocity(&trajectory, e, &states[n + 1], &samples[n + 1])?;
        now = next;
        let mut a = to * through * from;
        for i in 0..2 * nv {
            for j in 0..2 * nv {
                a[(i, j)] *= unit[j] / unit[i];
            }
        }
        let factor = largest(&a);
        out.largest_step.raise(factor, n, samples[n].time);
        product = a * product;
        let norm = product.amax();
        if norm > 0.0 {
            product /= norm;
            size += norm.ln();
        }
        let so_far = (size + largest(&product).ln()).exp().min(f64::MAX);
        out.course.push(so_far);
        out.peak.raise(so_far, n + 1, samples[n + 1].time);
        out.total = so_far;
    }
    Ok(out)
}

fn largest(a: &DMatrix<f64>) -> f64 {
    a.singular_values().max()
}

/// A matrix from its rows, which are found side by side.
fn rows(n: usize, row: impl Fn(StateBar) -> Result<StateBar> + Sync) -> Result<DMatrix<f64>> {
    let each = (0..2 * n).into_par_iter();
    let found: Result<Vec<_>> = each.map(|i| row(StateBar::unit(n, i))).collect();
    Ok(StateBar::stacked(n, &found?))
}

/// B: rows are cotangents of the state before the step.
fn through(step: &ControlledStep, nv: usize) -> Result<DMatrix<f64>> {
    let zero = Seed::zeros(nv);
    rows(nv, |next_bar| Ok(step.vjp(&next_bar, &zero)?.0))
}

/// T: what (q, v) are in (q, y).
fn to_velocity(
    t: &Trajectory,
    e: &Linearisation,
    state: &State,
    sample: &Sample,
) -> Result<DMatrix<f64>> {
    rows(state.y.len(), |StateBar { q, y: v }| {
        let mut bar = StepBar::zeros(e);
        t.stepper.velocity_vjp(e, state, &sample.v, &v, &mut bar)?;
        bar.state.q += q;
        Ok(bar.state)
    })
}

/// T⁻¹: what (q, y) are in (q, v).
fn from_velocity(
    t: &Trajectory,
    e: &Linearisation,
    state: &State,
    sample: &Sample,
) -> Result<DMatrix<f64>> {
    // What no change of the state can move.
    let split = t.stepper.split_at(state);
    rows(state.y.len(), |StateBar { q, mut y }| {
        let mut bar = StepBar::zeros(e);
        split.forget_driven(&mut y);
        t.stepper.conserved_vjp(e, &sample.v, &y, &mut bar)?;
        let (mut q, mut v) = (bar.state.q + q, bar.v);
        split.forget_moved(&mut q);
        split.forget_driven(&mut v);
        Ok(StateBar { q, y: v })
    })
}
