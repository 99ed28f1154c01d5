//! Where a step starts: what steps and their transposes have in common, whatever the integrator.

use super::plan::Plan;
use super::split::{Split, When};
use super::{Input, Integrator, State, StateBar, StepBar, StepTangents, Stepper};
use crate::Result;
use crate::dynamics::slopes::unit;
use crate::dynamics::{Evaluation, Linearisation};
use nalgebra::{DMatrix, DVector};

/// The start of a step.
#[derive(Clone, Copy)]
pub(super) struct Start<'s, 'a> {
    pub stepper: &'s Stepper<'a>,
    /// At the state's configuration.
    pub e: &'s Linearisation<'a>,
    /// The same with the contacts that this step sees.
    pub near: &'s Evaluation<'a>,
    /// How the step is cut of which this is a piece, or the whole.
    pub plan: &'s Plan,
    pub state: &'s State,
    /// Velocity read out at the state.
    pub v: &'s DVector<f64>,
    pub input: &'s Input,
    /// Which velocities are free during the step.
    pub split: &'s Split,
}

impl Stepper<'_> {
    /// Velocities as they are split during a step: over the whole of it, but for methods whose stages have times of their own.
    pub(super) fn split_of_step(&self, state: &State, input: &Input) -> Split {
        let t = self.time(state);
        let when = match self.integrator {
            Integrator::Rk2 | Integrator::Rk4 => When::At(t),
            _ => When::Over(t, self.dt),
        };
        self.split(&input.hold, when)
    }
}

impl Start<'_, '_> {
    /// Message of a stage that failed.
    pub fn stage_name(&self) -> String {
        let (s, state) = (self.stepper, self.state);
        let n = self.plan.pieces;
        let piece = match n {
            1 => String::new(),
            _ => format!(", piece {} of {n}", state.step % n + 1),
        };
        format!(
            "implicit stage of step {}{piece} (t = {} s, Δt = {} s)",
            state.step / n,
            s.time(state),
            s.dt
        )
    }

    /// Velocities whose joints were held before and are free in this step.
    fn released(&self) -> Vec<usize> {
        let before = self.stepper.split_at(self.state).is_driven;
        let free = (0..before.len()).filter(|&i| before[i] && !self.split.is_driven[i]);
        free.collect()
    }

    /// Momenta at the start of a step: those of joints that were held and now are free again
    /// follow from the velocity.
    pub fn momentum(&self) -> DVector<f64> {
        let released = self.released();
        let mut p = self.state.y.clone();
        if !released.is_empty() {
            let fresh = self.e.frame_momentum(self.v);
            released.iter().for_each(|&i| p[i] = fresh[i]);
        }
        p
    }

    /// Tangents of [`Start::momentum`].
    pub fn momentum_jvp(&self, along: &StepTangents) -> Result<DMatrix<f64>> {
        let mut p = along.y.clone();
        for i in self.released() {
            let mut row = StepBar::zeros(self.e);
            self.momentum_vjp(&unit(p.nrows(), i), &mut row)?;
            p.row_mut(i).tr_copy_from(&row.along(along));
        }
        Ok(p)
    }

    /// Transpose of [`Start::momentum`], added to `bar`.
    pub fn momentum_vjp(&self, p_bar: &DVector<f64>, bar: &mut StepBar) -> Result<()> {
        let (e, v) = (self.e, self.v);
        let released = self.released();
        let mut kept = p_bar.clone();
        if !released.is_empty() {
            let mut fresh_bar = DVector::zeros(p_bar.len());
            for i in released {
                fresh_bar[i] = std::mem::take(&mut kept[i]);
            }
            // p̂ = X⁻ᵀ p(q, v), the gradient of fresh_bar · p̂.
            let w = e.frame_velocity_inverse(&fresh_bar);
            let m = e.momentum_vjp(v, &w)?;
            bar.v += &m.v;
            bar.state.q += &m.q - e.frame_velocity_vjp(&w, &e.frame_momentum(v));
            bar.parameters.add(&m.parameters);
        }
        bar.state.y += kept;
        Ok(())
    }

    /// Coordinates after the step, which moves by `v`; motions placed.
    pub fn advance(&self, v: &DVector<f64>) -> DVector<f64> {
        self.arrive(&(self.stepper.dt * v))
    }

    /// Coordinates after a step by the chart coordinates `xi`; motions placed.
    pub fn arrive(&self, xi: &DVector<f64>) -> DVector<f64> {
        let s = self.stepper;
        let mut q = s.system.tree.integrate(&self.state.q, xi);
        s.place_motions(&mut q, (self.state.step + 1) as f64 * s.dt);
        q
    }

    /// Tangents of [`Start::arrive`].
    pub fn arrive_jvp(
        &self,
        xi: &DVector<f64>,
        q: &DMatrix<f64>,
        along: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut out = self.stepper.system.tree.integrate_jvp(xi, q, along);
        self.split.forget_moved_rows(&mut out);
        out
    }

    /// Transpose of [`Start::arrive`]: cotangents of q and of the chart coordinates.
    pub fn arrive_vjp(
        &self,
        xi: &DVector<f64>,
        q_bar: &DVector<f64>,
    ) -> (DVector<f64>, DVector<f64>) {
        let mut q_bar = q_bar.clone();
        self.split.forget_moved(&mut q_bar);
        self.stepper.system.tree.integrate_vjp(xi, &q_bar)
    }

    /// Tangents of [`Start::advance`].
    pub fn advance_jvp(
        &self,
        v: &DVector<f64>,
        q: &DMatrix<f64>,
        along: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let dt = self.stepper.dt;
        self.arrive_jvp(&(dt * v), q, &(dt * along))
    }

    /// Transpose of [`Start::advance`]: cotangents of q and of the velocity.
    pub fn advance_vjp(
        &self,
        v: &DVector<f64>,
        q_bar: &DVector<f64>,
    ) -> (DVector<f64>, DVector<f64>) {
        let dt = self.stepper.dt;
        let (q, xi) = self.arrive_vjp(&(dt * v), q_bar);
        (q, dt * xi)
    }

    /// The state after the step. Driven joints carry no momentum of their own.
    pub fn next_state(&self, q: DVector<f64>, mut y: DVector<f64>) -> State {
        if !self.stepper.integrator.carries_velocity() {
            self.split.forget_driven(&mut y);
        }
        State {
            step: self.state.step + 1,
            q,
            y,
            held: self.input.hold.clone(),
            mode: self.state.mode,
        }
    }

    /// Tangents of the momenta after the step, of which driven joints carry none.
    pub fn next_momenta(&self, mut y: DMatrix<f64>) -> DMatrix<f64> {
        self.split.forget_driven_rows(&mut y);
        y
    }

    /// Cotangent of the momenta after the step, of which driven joints carry none.
    pub fn next_momentum_bar(&self, next_bar: &StateBar) -> DVector<f64> {
        let mut out = next_bar.y.clone();
        self.split.forget_driven(&mut out);
        out
    }
}
