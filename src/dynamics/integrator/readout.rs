//! The velocity at a state, v = M(q)⁻¹ (Xᵀ p̂ − p_rest), and its transpose.

use super::split::{Split, When};
use super::{State, StateTangents, StepBar, Stepper};
use crate::Result;
use crate::dynamics::slopes::columns;
use crate::dynamics::{Evaluation, InputTangents, Linearisation, Slopes};
use nalgebra::{DMatrix, DVector};

/// v with driven entries given and free ones from momentum p̂.
pub(super) fn solve(e: &Evaluation, split: &Split, hat: &DVector<f64>) -> Result<DVector<f64>> {
    let right = e.user_momentum(hat) - &e.rest_momentum;
    e.velocity(&split.free, right, &split.driven)
}

/// Tangents of [`solve`] along those of q, p̂ and the parameters, from the derivatives of M v + p_rest: M dv = Xᵀ dp̂ + d(Xᵀ) p̂ − d(M v + p_rest).
pub(super) fn solve_jvp(
    e: &Linearisation,
    split: &Split,
    hat: &DVector<f64>,
    momentum: &Slopes,
    at: &StateTangents,
    inputs: &InputTangents,
) -> Result<DMatrix<f64>> {
    let right = e.frame_matrix().tr_mul(&at.y) + e.frame_momentum_slope(hat) * &at.q
        - momentum.along(&at.q, None, inputs);
    let found = e.factored(&split.free)?.solve_columns(&right);
    e.check()?;
    Ok(found)
}

/// Transpose of [`solve`], added to `bar` (y is p̂ here).
pub(super) fn solve_vjp(
    e: &Linearisation,
    split: &Split,
    hat: &DVector<f64>,
    v: &DVector<f64>,
    v_bar: &DVector<f64>,
    bar: &mut StepBar,
) -> Result<()> {
    let w = e.factored(&split.free)?.solve_vjp(v_bar);
    bar.add(-1.0, &e.momentum_vjp(v, &w)?);
    bar.state.q += e.frame_velocity_vjp(&w, hat);
    bar.state.y += e.frame_velocity(&w);
    Ok(())
}

/// A velocity v that is read out from momenta p̂.
pub(super) struct ReadOut<'s> {
    pub split: &'s Split,
    pub hat: &'s DVector<f64>,
    pub v: &'s DVector<f64>,
}

/// Transpose of the force f(q, v, u) at a velocity that is read out, with the cotangents `z` of the one and, from elsewhere, `v_bar` of the other, added to `bar` (y is p̂ here).
pub(super) fn force_vjp(
    e: &Linearisation,
    at: &ReadOut,
    control: &DVector<f64>,
    [z, v_bar]: [&DVector<f64>; 2],
    bar: &mut StepBar,
) -> Result<()> {
    let ReadOut { split, hat, v } = *at;
    let Some((w, found)) = e.force_readout_vjp(v, control, z, &split.free, v_bar)? else {
        let force = e.force_vjp(v, control, z)?;
        bar.add(1.0, &force);
        return solve_vjp(e, split, hat, v, &(v_bar + &force.v), bar);
    };
    bar.add(1.0, &found);
    bar.state.q += e.frame_velocity_vjp(&w, hat);
    bar.state.y += e.frame_velocity(&w);
    Ok(())
}

impl Stepper<'_> {
    /// Generalised velocity at a state.
    ///
    /// # Errors
    /// A mass matrix that isn't positive definite.
    pub fn velocity(&self, e: &Evaluation, state: &State) -> Result<DVector<f64>> {
        let split = self.split_at(state);
        if self.integrator.carries_velocity() {
            return Ok(&split.driven + split.put(&split.take(&state.y)));
        }
        solve(e, &split, &state.y)
    }

    /// Derivatives of the momenta at the velocity `v`, those with respect to the parameters if they are asked for, for [`Stepper::velocity_jvp`] and [`Stepper::conserved_jvp`]; none for integrators that carry
    /// the velocity.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn momentum_slopes(
        &self,
        e: &Linearisation,
        v: &DVector<f64>,
        by_parameters: bool,
    ) -> Result<Option<Slopes>> {
        if self.integrator.carries_velocity() {
            return Ok(None);
        }
        let all: Vec<usize> = (0..v.len()).collect();
        e.momentum_slopes(v, &all, by_parameters).map(Some)
    }

    /// Tangents of [`Stepper::velocity`] along those of the state and, of the inputs, the parameters.
    ///
    /// # Errors
    /// As the value.
    pub fn velocity_jvp(
        &self,
        e: &Linearisation,
        state: &State,
        momentum: Option<&Slopes>,
        at: &StateTangents,
        inputs: &InputTangents,
    ) -> Result<DMatrix<f64>> {
        let split = self.split_at(state);
        match momentum {
            None => Ok(split.put_rows(&split.take_rows(&at.y))),
            Some(momentum) => solve_jvp(e, &split, &state.y, momentum, at, inputs),
        }
    }

    /// Transpose of [`Stepper::velocity`]: adds to the cotangents of the state and parameters.
    ///
    /// # Errors
    /// As the value, or a solve of the coupling.
    pub fn velocity_vjp(
        &self,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
        v_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> Result<()> {
        let split = self.split_at(state);
        if v_bar.iter().all(|x| *x == 0.0) {
            return Ok(());
        }
        if self.integrator.carries_velocity() {
            bar.state.y += split.put(&split.take(v_bar));
            return Ok(());
        }
        solve_vjp(e, &split, &state.y, v, v_bar, bar)
    }

    /// Velocity that belongs to the generalised momentum `p` (user coordinates, that of drifting bodies in the world) at `e`, at t = 0.
    ///
    /// # Errors
    /// A mass matrix that isn't positive definite.
    pub fn velocity_of_momentum(&self, e: &Evaluation, p: &DVector<f64>) -> Result<DVector<f64>> {
        let drifting = p - e.drift_momentum();
        solve(e, &self.split(&[], When::At(0.0)), &e.frame_dual(&drifting))
    }

    /// The conserved variable y that belongs to velocity `v` at `e`.
    pub fn conserved(&self, e: &Evaluation, v: &DVector<f64>) -> DVector<f64> {
        if self.integrator.carries_velocity() {
            v.clone()
        } else {
            e.frame_momentum(v)
        }
    }

    /// Tangents of [`Stepper::conserved`] along those of q, of v and, of the inputs, the parameters: Xᵀ dp̂ = dp − d(Xᵀ) p̂.
    pub fn conserved_jvp(
        &self,
        e: &Linearisation,
        v: &DVector<f64>,
        momentum: Option<&Slopes>,
        q: &DMatrix<f64>,
        along: &DMatrix<f64>,
        inputs: &InputTangents,
    ) -> DMatrix<f64> {
        let Some(momentum) = momentum else {
            return along.clone();
        };
        let user = momentum.along(q, Some(along), inputs)
            - e.frame_momentum_slope(&e.frame_momentum(v)) * q;
        columns(&user, |p| e.frame_dual(p))
    }

    /// Transpose of [`Stepper::conserved`]: cotangents of q (added to `bar.state.q`) and of v
    /// (added to `bar.v`), and of the parameters.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn conserved_vjp(
        &self,
        e: &Linearisation,
        v: &DVector<f64>,
        y_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> Result<()> {
        if self.integrator.carries_velocity() {
            bar.v += y_bar;
            return Ok(());
        }
        let w = e.frame_velocity_inverse(y_bar);
        let m = e.momentum_vjp(v, &w)?;
        bar.v += &m.v;
        bar.add(1.0, &m);
        bar.state.q -= e.frame_velocity_vjp(&w, &e.frame_momentum(v));
        Ok(())
    }
}
