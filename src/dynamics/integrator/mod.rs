//! Time integration: one step as a pure function of (state, control, parameters), and its adjoint.
//!
//! | integrator | conserved variable y | order | cost per step |
//! |---|---|---|---|
//! | [`Integrator::MomentumEuler`] | frame momentum p̂ | 1, symplectic | 1 evaluation |
//! | [`Integrator::EnergyEuler`] | frame momentum p̂ | 1, keeps energy | 1, and one of values |
//! | [`Integrator::Midpoint`] | frame momentum p̂ | 2, symmetric | about 4 to 6 |
//! | [`Integrator::Rk2`] | frame momentum p̂ | 2 | 2 |
//! | [`Integrator::Rk4`] | frame momentum p̂ | 4 | 4 |
//! | [`Integrator::VelocityEuler`] | velocity v | 1 | 1 |
//!
//! All but the Runge–Kutta schemes solve contact, at the end of the step ([`Integrator::solves_contact`]).
//!
//! Joints that are driven (locked, held by the controller, or given a motion) have known
//! velocities v_d; the others follow from rows f of the momentum balance (p_f = M_ff v_f + M_fd v_d).

mod ahead;
mod contact;
mod end_contact;
mod energy;
mod euler;
mod frozen;
mod hessian;
mod hold;
mod line;
mod middle_contact;
mod midpoint;
mod motion_push;
mod pieces;
mod plan;
mod quasi;
mod reaction;
mod readout;
mod record;
mod region;
mod rule;
mod runge_kutta;
mod solved;
mod split;
mod stage_adjoint;
mod stage_factor;
mod stage_force;
mod stage_matrix;
mod stages;
mod start;
mod velocity_euler;

pub use plan::Stops;
pub use record::{LinearisedStep, StepRecord};
pub use solved::Solved;
pub use stages::ContactVelocities;

use super::{Drive, Evaluation, ForceCotangents, InputTangents, Linearisation, Parameters, System};
use crate::Result;
use nalgebra::{DMatrix, DVector};

choices! {
    /// How time is stepped. The default is the one that costs least for its accuracy
    /// (`docs/integrators.md`).
    pub enum Integrator {
        /// Symplectic Euler in momentum, implicit in p at fixed q: first order, one evaluation a step.
        MomentumEuler,
        /// The same, brought to the kinetic energy that it started with and the work of the forces: what it is worth where gaps close.
        EnergyEuler,
        /// Implicit midpoint in momentum: second order, symmetric, energy bounded.
        Midpoint,
        /// Explicit midpoint rule in momentum: second order, two evaluations.
        Rk2,
        /// Classical Runge–Kutta in momentum: fourth order, four evaluations.
        #[default]
        Rk4,
        /// Semi-implicit Euler in velocity (the paper's Eq. 3–4): first order.
        VelocityEuler,
    }
}

impl Integrator {
    /// Whether the state carries velocity instead of momentum.
    pub fn carries_velocity(self) -> bool {
        self == Integrator::VelocityEuler
    }

    /// Largest rate of damping times the time step at which it is stable, of integrators that take forces at the velocity before the step (explicitly): of a motion that
    /// dies away at the rate λ a step leaves 1 − λΔt (velocity Euler), with ½(λΔt)² (RK2) or the series to the fourth order (RK4).
    pub fn damping_limit(self) -> Option<f64> {
        match self {
            Integrator::VelocityEuler | Integrator::Rk2 => Some(2.0),
            Integrator::Rk4 => Some(2.785),
            Integrator::MomentumEuler | Integrator::EnergyEuler | Integrator::Midpoint => None,
        }
    }

    /// Largest angular frequency times the time step at which it is stable, of integrators that take forces where a step starts: a swing grows beyond 2 without bound (the Eulers, which are symplectic) or
    /// beyond √8 (RK4). Of RK2, with which all swings grow, the one that grows by an eighth a radian.
    pub fn swing_limit(self) -> Option<f64> {
        match self {
            Integrator::MomentumEuler | Integrator::EnergyEuler | Integrator::VelocityEuler => {
                Some(2.0)
            }
            Integrator::Rk2 => Some(1.0),
            Integrator::Rk4 => Some(std::f64::consts::SQRT_2 * 2.0),
            Integrator::Midpoint => None,
        }
    }

    /// Answers of the water that are kept of a step, where many bodies are coupled by products.
    pub(crate) fn answers(self) -> usize {
        match self {
            Integrator::Rk2 => 2,
            Integrator::Rk4 => 4,
            // That at the start, of velocities before and after contact, and of that at the end.
            Integrator::Midpoint => 4,
            // That at the start, and of velocities before and after contact.
            _ => 3,
        }
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

/// Tangents of a state, a column for each direction.
#[derive(Clone, Debug, PartialEq)]
pub struct StateTangents {
    /// Of q, in its tangent space: nv × K.
    pub q: DMatrix<f64>,
    /// Of y, nv × K.
    pub y: DMatrix<f64>,
}

impl StateBar {
    /// That of entry `row` of (q, y), of a system with `nv` velocities.
    pub fn unit(nv: usize, row: usize) -> Self {
        let entry = |from: usize| DVector::from_fn(nv, |i, _| f64::from(from + i == row));
        Self {
            q: entry(0),
            y: entry(nv),
        }
    }
}

/// Tangents of all that a step starts from, a column for each direction.
pub(super) struct StepTangents<'t> {
    /// Of the coordinates and of y.
    pub q: &'t DMatrix<f64>,
    pub y: &'t DMatrix<f64>,
    /// Of the velocity read out at the state.
    pub v: &'t DMatrix<f64>,
    pub inputs: &'t InputTangents,
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

impl<'a> Stepper<'a> {
    /// Time of a state, s.
    pub fn time(&self, state: &State) -> f64 {
        state.step as f64 * self.dt
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

    /// [`System::evaluate`] at a state's configuration and time (s): what its readout needs.
    ///
    /// # Errors
    /// As there.
    pub fn evaluate(&self, q: &DVector<f64>, time: f64) -> Result<Evaluation<'a>> {
        self.system.evaluate(self.parameters, q, time)
    }

    /// [`System::linearise`] at a state's configuration and time (s), shared by its readout, its step and their transposes.
    ///
    /// # Errors
    /// As there.
    pub fn linearise(&self, q: &DVector<f64>, time: f64) -> Result<Linearisation<'a>> {
        self.system.linearise(self.parameters, q, time)
    }
}

/// Cotangents that a step hands back.
#[derive(Clone, Debug)]
pub struct StepBar {
    /// Of the state.
    pub state: StateBar,
    /// Of the velocity read out at the state, as far as it isn't carried on to that.
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

    /// Products with directions of all that a step starts from.
    fn along(&self, at: &StepTangents) -> DVector<f64> {
        at.q.tr_mul(&self.state.q)
            + at.y.tr_mul(&self.state.y)
            + at.v.tr_mul(&self.v)
            + at.inputs.control.tr_mul(&self.control)
            + at.inputs.of_parameters(&self.parameters)
    }

    /// Adds `scale` times the cotangents of a force or momentum (configuration, control, parameters; not v).
    fn add(&mut self, scale: f64, f: &ForceCotangents) {
        self.state.q += scale * &f.q;
        self.control += scale * &f.control;
        self.parameters.add_scaled(scale, &f.parameters);
    }
}
