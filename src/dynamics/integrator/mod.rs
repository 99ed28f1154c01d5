//! Time integration: one step as a pure function of (state, control, parameters), and its adjoint.
//!
//! | integrator | conserved variable y | order | cost per step |
//! |---|---|---|---|
//! | [`Integrator::MomentumEuler`] | frame momentum p̂ | 1, symplectic | 1 evaluation |
//! | [`Integrator::Midpoint`] | frame momentum p̂ | 2, symmetric | about 4 to 8 |
//! | [`Integrator::Rk2`] | frame momentum p̂ | 2 | 2 |
//! | [`Integrator::Rk4`] | frame momentum p̂ | 4 | 4 |
//! | [`Integrator::VelocityEuler`] | velocity v | 1 | 1 |
//!
//! All but the Runge–Kutta schemes solve contact, at the end of the step ([`Integrator::solves_contact`]).
//!
//! Joints that are driven (locked, held by the controller, or given a motion) have known
//! velocities v_d; the others follow from rows f of the momentum balance (p_f = M_ff v_f + M_fd v_d).

mod contact;
mod euler;
mod midpoint;
mod readout;
mod runge_kutta;
mod velocity_euler;

use super::{Drive, Evaluation, ForceCotangents, Linearisation, Parameters, System};
use crate::Result;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// How time is stepped. The default is the cheapest that keeps the energy error of every example scene under 1 %
/// (`docs/integrators.md`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Euler in momentum, implicit in p at fixed q: symplectic, one evaluation a step.
    MomentumEuler,
    /// Implicit midpoint in momentum: second order, symmetric.
    Midpoint,
    /// Explicit midpoint rule in momentum: second order.
    #[default]
    Rk2,
    /// Classical Runge–Kutta in momentum: fourth order, explicit.
    Rk4,
    /// The paper's semi-implicit Euler in velocity (Eq. 3–4).
    VelocityEuler,
}

impl Integrator {
    /// Whether the state carries velocity instead of momentum.
    pub fn carries_velocity(self) -> bool {
        self == Integrator::VelocityEuler
    }

    /// Whether it solves contact, and limits of joints, in the velocity by which a step moves.
    pub fn solves_contact(self) -> bool {
        !matches!(self, Integrator::Rk2 | Integrator::Rk4)
    }
}

/// State between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Number of steps made; time is `step · Δt`.
    pub step: usize,
    /// Joint coordinates.
    pub q: DVector<f64>,
    /// Conserved variable: frame momentum p̂ or, for [`Integrator::VelocityEuler`], velocity v.
    pub y: DVector<f64>,
    /// Bodies whose joints the controller held during the step that led here.
    pub held: Vec<bool>,
    /// What the controller remembers; no integrator reads it.
    pub mode: usize,
}

/// What acts during a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Controls u.
    pub control: DVector<f64>,
    /// Joints to hold, per body; an empty list holds none.
    pub hold: Vec<bool>,
}

/// Tangent cotangent of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateBar {
    /// Of q, in its tangent space (length nv).
    pub q: DVector<f64>,
    /// Of y.
    pub y: DVector<f64>,
}

/// What one step needs beside the state: the system, its parameters, the scheme.
#[derive(Clone, Copy)]
pub struct Stepper<'a> {
    /// The system.
    pub system: &'a System,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// The scheme.
    pub integrator: Integrator,
    /// Time step, s.
    pub dt: f64,
}

/// Inner stages (a converged one, or the forces that others start from), kept with a trajectory so that the reverse sweep needn't iterate again.
pub type Memo = Option<DVector<f64>>;

/// The velocity with which contacts act during a step, from what was kept of it; `v` where nothing was.
pub fn contact_velocity(memo: &Memo, v: &DVector<f64>) -> DVector<f64> {
    match memo {
        Some(both) if both.len() == 2 * v.len() => contact::parted(both, v.len()).1,
        _ => v.clone(),
    }
}

/// Result of a step.
pub struct Stepped {
    /// The next state.
    pub state: State,
    /// To be handed back when the step is redone for its adjoint.
    pub memo: Memo,
}

/// Which velocities are free, and the values of the others.
#[derive(Clone, Debug)]
pub(super) struct Split {
    /// Indices of free velocities.
    pub free: Vec<usize>,
    /// Full-length velocity with driven values set and zeros elsewhere.
    pub driven: DVector<f64>,
    /// Per velocity: coordinate given by a motion.
    pub moved: Vec<bool>,
    /// Per velocity: driven in any way.
    pub is_driven: Vec<bool>,
}

impl Split {
    /// Free part of a vector.
    pub fn take(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| x[i]))
    }

    /// Scatter of a free part into zeros.
    pub fn put(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.driven.len());
        for (k, &i) in self.free.iter().enumerate() {
            out[i] = x[k];
        }
        out
    }

    /// Free rows and columns.
    pub fn block(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        m.select_rows(&self.free).select_columns(&self.free)
    }

    /// Zeroes the entries whose value doesn't depend on the state: given motions.
    pub fn forget_moved(&self, x: &mut DVector<f64>) {
        for (x, moved) in x.iter_mut().zip(&self.moved) {
            if *moved {
                *x = 0.0;
            }
        }
    }

    /// Zeroes driven entries.
    pub fn forget_driven(&self, x: &mut DVector<f64>) {
        for (x, driven) in x.iter_mut().zip(&self.is_driven) {
            if *driven {
                *x = 0.0;
            }
        }
    }
}

/// When a given motion's velocity is wanted.
#[derive(Clone, Copy)]
pub(super) enum When {
    /// Exactly, at a time (s).
    At(f64),
    /// As the mean over a step that starts at a time (s).
    Over(f64, f64),
}

impl<'a> Stepper<'a> {
    /// Time of a state, s.
    pub fn time(&self, state: &State) -> f64 {
        state.step as f64 * self.dt
    }

    /// Splits velocities into free and driven ones.
    pub(super) fn split(&self, held: &[bool], when: When) -> Split {
        let nv = self.system.tree.velocities();
        let mut out = Split {
            free: Vec::new(),
            driven: DVector::zeros(nv),
            moved: vec![false; nv],
            is_driven: vec![false; nv],
        };
        for (b, link) in self.system.tree.links().iter().enumerate() {
            let is_held = held.get(b).copied().unwrap_or(false);
            for (k, i) in link.v.clone().enumerate() {
                match &self.system.drives[b] {
                    Drive::Motion(motions) => {
                        out.moved[i] = true;
                        out.is_driven[i] = true;
                        out.driven[i] = match when {
                            When::At(t) => motions[k].rate(t),
                            When::Over(t, dt) => {
                                (motions[k].value(t + dt) - motions[k].value(t)) / dt
                            }
                        };
                    }
                    Drive::Free if !is_held => out.free.push(i),
                    _ => out.is_driven[i] = true,
                }
            }
        }
        out
    }

    /// Sets coordinates given by motions to their values at time `t`.
    pub fn place_motions(&self, q: &mut DVector<f64>, t: f64) {
        for (drive, link) in self.system.drives.iter().zip(self.system.tree.links()) {
            if let Drive::Motion(motions) = drive {
                for (k, i) in link.q.clone().enumerate() {
                    q[i] = motions[k].value(t);
                }
            }
        }
    }

    /// [`System::evaluate`] at a state's configuration: what its readout needs.
    ///
    /// # Errors
    /// As there.
    pub fn evaluate(&self, q: &DVector<f64>) -> Result<Evaluation<'a>> {
        self.system.evaluate(self.parameters, q)
    }

    /// [`System::linearise`] at a state's configuration, shared by its readout, its step and their transposes.
    ///
    /// # Errors
    /// As there.
    pub fn linearise(&self, q: &DVector<f64>) -> Result<Linearisation<'a>> {
        self.system.linearise(self.parameters, q)
    }

    /// One step from `state`, at which `e` was evaluated and where the velocity is `v`
    /// ([`Stepper::velocity`]).
    ///
    /// # Errors
    /// A solve that misses its tolerance or a step too long for its implicit stage.
    pub fn step(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        v: &DVector<f64>,
        input: &Input,
    ) -> Result<Stepped> {
        match self.integrator {
            Integrator::MomentumEuler => euler::step(self, e, state, v, input),
            Integrator::Midpoint => midpoint::step(self, e, state, v, input),
            Integrator::Rk2 | Integrator::Rk4 => runge_kutta::step(self, e, state, v, input),
            Integrator::VelocityEuler => velocity_euler::step(self, e, state, v, input),
        }
    }

    /// Transpose of [`Stepper::step`]: cotangents of the state (in q and y), of v, of the control
    /// and of the parameters, from that of the next state.
    ///
    /// # Errors
    /// As the step itself.
    pub fn step_vjp(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        v: &DVector<f64>,
        input: &Input,
        memo: &Memo,
        next_bar: &StateBar,
    ) -> Result<StepBar> {
        match self.integrator {
            Integrator::MomentumEuler => euler::step_vjp(self, e, state, v, input, memo, next_bar),
            Integrator::Midpoint => midpoint::step_vjp(self, e, state, v, input, memo, next_bar),
            Integrator::Rk2 | Integrator::Rk4 => {
                runge_kutta::step_vjp(self, e, state, v, input, memo, next_bar)
            }
            Integrator::VelocityEuler => {
                velocity_euler::step_vjp(self, e, state, v, input, memo, next_bar)
            }
        }
    }

    /// Momenta at the start of a step: those of joints that were held and now are free again
    /// follow from the velocity.
    fn released_momentum(
        &self,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
        split: &Split,
    ) -> DVector<f64> {
        let released = self.released(state, split);
        let mut p = state.y.clone();
        if released.iter().any(|r| *r) {
            let fresh = e.frame_momentum(v);
            for (i, r) in released.iter().enumerate() {
                if *r {
                    p[i] = fresh[i];
                }
            }
        }
        p
    }

    /// Velocities whose joints were held before and are free in this step.
    fn released(&self, state: &State, split: &Split) -> Vec<bool> {
        let before = self.split(&state.held, When::At(self.time(state)));
        (0..split.driven.len())
            .map(|i| before.is_driven[i] && !split.is_driven[i])
            .collect()
    }

    /// Transpose of [`Stepper::released_momentum`], added to `bar`.
    fn released_momentum_vjp(
        &self,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
        split: &Split,
        p_bar: &DVector<f64>,
        bar: &mut StepBar,
    ) -> Result<()> {
        let released = self.released(state, split);
        let mut kept = p_bar.clone();
        if released.iter().any(|r| *r) {
            let mut fresh_bar = DVector::zeros(p_bar.len());
            for (i, r) in released.iter().enumerate() {
                if *r {
                    fresh_bar[i] = p_bar[i];
                    kept[i] = 0.0;
                }
            }
            // p̂ = X⁻ᵀ p(q, v), the gradient of fresh_bar · p̂.
            let w = e
                .system
                .tree
                .per_joint(&e.q, &fresh_bar, |j, q, z| j.frame_velocity_inverse(q, z));
            let m = e.momentum_vjp(v, &w)?;
            bar.v += &m.v;
            bar.state.q += &m.q - e.frame_velocity_vjp(&w, &e.frame_momentum(v));
            bar.parameters.add(&m.parameters);
        }
        bar.state.y += kept;
        Ok(())
    }
}

/// Cotangents that a step hands back.
#[derive(Clone, Debug)]
pub struct StepBar {
    /// Of the state.
    pub state: StateBar,
    /// Of the velocity read out at the state.
    pub v: DVector<f64>,
    /// Of the control.
    pub control: DVector<f64>,
    /// Of the parameters.
    pub parameters: Parameters,
}

impl StepBar {
    /// All zero.
    pub fn zeros(e: &Evaluation) -> Self {
        let nv = e.system.tree.velocities();
        Self {
            state: StateBar {
                q: DVector::zeros(nv),
                y: DVector::zeros(nv),
            },
            v: DVector::zeros(nv),
            control: DVector::zeros(e.system.controls),
            parameters: e.parameters.zeros(),
        }
    }

    /// Adds `scale` times the cotangents of a force or momentum (configuration, control, parameters; not v).
    fn add(&mut self, scale: f64, f: &ForceCotangents) {
        self.state.q += scale * &f.q;
        self.control += scale * &f.control;
        self.parameters.add_scaled(scale, &f.parameters);
    }
}
