//! What a step leaves behind, and its derivatives.

use super::split::Split;
use super::stages::{ContactVelocities, Stages, Transposed};
use super::start::Start;
use super::{Input, Integrator, State, StateBar, StateTangent, StepBar, Stepper};
use super::{euler, midpoint, runge_kutta, velocity_euler};
use crate::Result;
use crate::dynamics::Linearisation;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What a step leaves behind: where it started, what acted, how it was made, and its converged stages. It is small, and the only
/// key to the step's derivatives ([`Stepper::linearise_step`]), which needn't iterate again.
#[derive(Clone, Debug)]
pub struct StepRecord {
    state: State,
    v: DVector<f64>,
    input: Input,
    integrator: Integrator,
    dt: f64,
    stages: Stages,
}

impl StepRecord {
    /// The state before the step.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The velocity read out there.
    pub fn velocity(&self) -> &DVector<f64> {
        &self.v
    }

    /// What acted during the step.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// Velocities before and after contact; none of integrators that don't solve it.
    pub fn contact_velocities(&self) -> Option<&ContactVelocities> {
        match &self.stages {
            Stages::Contact(v) => Some(v),
            Stages::RungeKutta(_) => None,
        }
    }

    /// The velocity with which contacts act during the step.
    pub fn contact_velocity(&self) -> &DVector<f64> {
        self.contact_velocities().map_or(&self.v, |v| &v.after)
    }

    fn start<'s, 'a>(
        &'s self,
        stepper: &'s Stepper<'a>,
        e: &'s Linearisation<'a>,
        split: &'s Split,
    ) -> Start<'s, 'a> {
        Start {
            stepper,
            e,
            state: &self.state,
            v: &self.v,
            input: &self.input,
            split,
        }
    }
}

/// A step made again at its start, with what all its derivatives share: one evaluation, and the factored stages.
pub struct LinearisedStep<'s, 'a> {
    stepper: Stepper<'a>,
    record: &'s StepRecord,
    e: Linearisation<'a>,
    split: Split,
    adjoint: Box<dyn Transposed<'a> + 's>,
}

/// Derivatives of the state after a step, q in its tangent space and then y.
#[derive(Clone, Debug, PartialEq)]
pub struct StepJacobians {
    /// With respect to the state before it, in the same coordinates: 2nv × 2nv.
    pub state: DMatrix<f64>,
    /// With respect to the controls, 2nv × controls.
    pub control: DMatrix<f64>,
}

impl<'a> Stepper<'a> {
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
    ) -> Result<(State, StepRecord)> {
        let split = self.split_of_step(state, input);
        let start = Start {
            stepper: self,
            e,
            state,
            v,
            input,
            split: &split,
        };
        let (next, stages) = match self.integrator {
            Integrator::MomentumEuler => euler::step(&start)?,
            Integrator::Midpoint => midpoint::step(&start)?,
            Integrator::Rk2 => runge_kutta::step(&start, &runge_kutta::SECOND)?,
            Integrator::Rk4 => runge_kutta::step(&start, &runge_kutta::FOURTH)?,
            Integrator::VelocityEuler => velocity_euler::step(&start)?,
        };
        let record = StepRecord {
            state: state.clone(),
            v: v.clone(),
            input: input.clone(),
            integrator: self.integrator,
            dt: self.dt,
            stages,
        };
        Ok((next, record))
    }

    /// A step with what its derivatives share.
    ///
    /// # Errors
    /// As [`Stepper::linearise`], and as the step itself.
    pub fn linearise_step<'s>(&self, record: &'s StepRecord) -> Result<LinearisedStep<'s, 'a>>
    where
        'a: 's,
    {
        let stepper = Stepper {
            integrator: record.integrator,
            dt: record.dt,
            ..*self
        };
        let e = stepper.linearise(&record.state.q)?;
        let split = stepper.split_of_step(&record.state, &record.input);
        let start = record.start(&stepper, &e, &split);
        let adjoint: Box<dyn Transposed<'a> + 's> = match (&record.stages, record.integrator) {
            (Stages::RungeKutta(f), _) => Box::new(runge_kutta::Adjoint::new(&start, f)?),
            (Stages::Contact(v), Integrator::Midpoint) => {
                Box::new(midpoint::Adjoint::new(&start, v)?)
            }
            (Stages::Contact(v), Integrator::VelocityEuler) => {
                Box::new(velocity_euler::Adjoint::new(&start, v)?)
            }
            (Stages::Contact(v), _) => Box::new(euler::Adjoint::new(&start, v)?),
        };
        Ok(LinearisedStep {
            stepper,
            record,
            adjoint,
            e,
            split,
        })
    }
}

impl<'a> LinearisedStep<'_, 'a> {
    /// The system at the state before the step.
    pub fn linearisation(&self) -> &Linearisation<'a> {
        &self.e
    }

    /// What the step left behind.
    pub fn record(&self) -> &StepRecord {
        self.record
    }

    /// Transpose of [`Stepper::step`]: cotangents of the state (in q and y), of v, of the control
    /// and of the parameters, from that of the next state.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn vjp(&self, next_bar: &StateBar) -> Result<StepBar> {
        let start = self.record.start(&self.stepper, &self.e, &self.split);
        self.adjoint.vjp(&start, next_bar)
    }

    /// The same with the velocity read out at the state: all that the next state's cotangent is worth at the state itself.
    ///
    /// # Errors
    /// As [`LinearisedStep::vjp`].
    pub fn state_vjp(&self, next_bar: &StateBar) -> Result<StepBar> {
        let mut bar = self.vjp(next_bar)?;
        let v_bar = std::mem::replace(&mut bar.v, DVector::zeros(next_bar.q.len()));
        let record = self.record;
        self.stepper
            .velocity_vjp(&self.e, &record.state, &record.v, &v_bar, &mut bar)?;
        Ok(bar)
    }

    /// Jacobians of the next state at fixed controller, row by row from [`LinearisedStep::state_vjp`].
    ///
    /// # Errors
    /// As there.
    pub fn jacobians(&self) -> Result<StepJacobians> {
        let nv = self.record.v.len();
        let rows = (0..2 * nv).into_par_iter();
        let bars = rows.map(|row| self.state_vjp(&StateBar::unit(nv, row)));
        let bars = bars.collect::<Result<Vec<StepBar>>>()?;
        let control = |i: usize, j: usize| bars[i].control[j];
        let control = DMatrix::from_fn(2 * nv, self.record.input.control.len(), control);
        let states: Vec<StateBar> = bars.into_iter().map(|bar| bar.state).collect();
        Ok(StepJacobians {
            state: StateBar::stacked(nv, &states),
            control,
        })
    }

    /// Tangent of the next state along displacements of the state (q in its tangent space, y) and of the control, by
    /// [`LinearisedStep::jacobians`]: for several displacements at one step, take those.
    ///
    /// # Errors
    /// As there.
    pub fn jvp(&self, state: &StateTangent, control: &DVector<f64>) -> Result<StateTangent> {
        let nv = self.record.v.len();
        let all = self.jacobians()?;
        let stacked = DVector::from_iterator(2 * nv, state.q.iter().chain(state.y.iter()).copied());
        let out = all.state * stacked + all.control * control;
        Ok(StateTangent {
            q: out.rows(0, nv).into_owned(),
            y: out.rows(nv, nv).into_owned(),
        })
    }
}
