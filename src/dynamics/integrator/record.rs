//! What a step leaves behind, and its derivatives.
//!
//! A step may have been cut into equal pieces, each a step of its own with the same control and the same joints held; its derivatives go
//! through them in reverse, their number held fixed.

use super::plan::{Plan, Stops};
use super::split::Split;
use super::stages::{ContactVelocities, Stages, StepDerivatives};
use super::start::Start;
use super::{Input, Integrator, State, StateBar, StateTangents, StepBar, StepTangents, Stepper};
use super::{euler, midpoint, runge_kutta, velocity_euler};
use crate::Result;
use crate::dynamics::answers::Answers;
use crate::dynamics::force::CoarseGap;
use crate::dynamics::{Evaluation, InputTangents, Linearisation};
use nalgebra::{DMatrix, DVector};

/// What a step leaves behind: where it started, what acted, how it was made, and its converged stages; of many bodies that are coupled by products what the water answered, too. It is the only
/// key to the step's derivatives ([`Stepper::linearise_step`]), which needn't iterate again.
#[derive(Clone, Debug)]
pub struct StepRecord {
    pub(super) state: State,
    pub(super) v: DVector<f64>,
    pub(super) input: Input,
    pub(super) integrator: Integrator,
    pub(super) dt: f64,
    pub(super) plan: Plan,
    /// Of the step, or of its first piece.
    pub(super) stages: Stages,
    /// What the water answered at its start.
    pub(super) answers: Answers,
    pub(super) later: Vec<LaterPiece>,
    pub(super) passed: Stops,
    pub(super) coarse: Option<CoarseGap>,
}

/// A piece of a step after its first.
#[derive(Clone, Debug)]
pub(super) struct LaterPiece {
    /// Where it starts, steps counted in pieces.
    pub state: State,
    pub v: DVector<f64>,
    pub stages: Stages,
    pub answers: Answers,
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

    /// Number of equal pieces in which it was made; one where it wasn't cut.
    pub fn pieces(&self) -> usize {
        self.plan.pieces
    }

    /// What it went deep into, or past a joint's limit, in as many pieces as there may be.
    pub fn passed(&self) -> &Stops {
        &self.passed
    }

    /// The gap with viscous water that was resolved worst, of those that weren't.
    pub fn coarse(&self) -> Option<CoarseGap> {
        self.coarse
    }

    /// Velocities before and after contact, of a step in pieces those of the first; none of integrators that don't solve it.
    pub fn contact_velocities(&self) -> Option<&ContactVelocities> {
        self.stages.contact_velocities()
    }

    /// The pieces: each one's start with steps counted in pieces, the velocity read out there, what the water answered there, and its stages.
    pub(super) fn parts(&self) -> impl Iterator<Item = (State, &DVector<f64>, &Answers, &Stages)> {
        let first = State {
            step: self.plan.pieces * self.state.step,
            ..self.state.clone()
        };
        let later = self.later.iter();
        let later = later.map(|p| (p.state.clone(), &p.v, &p.answers, &p.stages));
        std::iter::once((first, &self.v, &self.answers, &self.stages)).chain(later)
    }
}

/// A step made again at its start, with what all its derivatives share: for each piece an evaluation and the factored stages.
pub struct LinearisedStep<'s, 'a> {
    record: &'s StepRecord,
    first: Part<'s, 'a>,
    later: Vec<Part<'s, 'a>>,
}

/// A piece of a step, or the whole, made again.
struct Part<'s, 'a> {
    stepper: Stepper<'a>,
    record: &'s StepRecord,
    state: State,
    v: &'s DVector<f64>,
    e: Linearisation<'a>,
    near: Option<Evaluation<'a>>,
    split: Split,
    derivatives: Box<dyn StepDerivatives<'a> + 's>,
}

impl<'a> Stepper<'a> {
    /// The same for the pieces of a step.
    pub(super) fn of_pieces(&self, record: &StepRecord) -> Self {
        Self {
            integrator: record.integrator,
            dt: record.dt / record.plan.pieces as f64,
            ..*self
        }
    }

    /// A step with what its derivatives share.
    ///
    /// # Errors
    /// As [`Stepper::linearise`], and as the step itself.
    pub fn linearise_step<'s>(&self, record: &'s StepRecord) -> Result<LinearisedStep<'s, 'a>>
    where
        'a: 's,
    {
        let stepper = self.of_pieces(record);
        type Begun<'s> = (State, &'s DVector<f64>, &'s Answers, &'s Stages);
        let part = |(state, v, answers, stages): Begun<'s>| {
            let e = stepper.linearise(&state.q, stepper.time(&state))?;
            e.recall(answers);
            let split = stepper.split_of_step(&state, &record.input);
            let near = stepper.near(&e, &split.complete(v), &record.plan)?;
            let start = Start {
                stepper: &stepper,
                e: &e,
                near: near.as_ref().unwrap_or(&e),
                plan: &record.plan,
                state: &state,
                v,
                input: &record.input,
                split: &split,
            };
            let derivatives: Box<dyn StepDerivatives<'a> + 's> = match (stages, record.integrator) {
                (Stages::RungeKutta(f), _) => Box::new(runge_kutta::Adjoint::new(&start, f)?),
                (Stages::Contact(v), Integrator::Midpoint) => {
                    Box::new(midpoint::Adjoint::new(&start, v)?)
                }
                (Stages::Contact(v), Integrator::VelocityEuler) => {
                    Box::new(velocity_euler::Adjoint::new(&start, v)?)
                }
                (Stages::Contact(v) | Stages::Touching(v), _) => {
                    Box::new(euler::Adjoint::new(&start, v)?)
                }
            };
            Ok(Part {
                stepper,
                record,
                state,
                v,
                e,
                near,
                split,
                derivatives,
            })
        };
        let mut parts = record.parts();
        let first = match parts.next() {
            Some(first) => part(first)?,
            None => part((
                record.state.clone(),
                &record.v,
                &record.answers,
                &record.stages,
            ))?,
        };
        Ok(LinearisedStep {
            record,
            first,
            later: parts.map(part).collect::<Result<_>>()?,
        })
    }
}

impl<'a> Part<'_, 'a> {
    fn start(&self) -> Start<'_, 'a> {
        Start {
            stepper: &self.stepper,
            e: &self.e,
            near: self.near.as_ref().unwrap_or(&self.e),
            plan: &self.record.plan,
            state: &self.state,
            v: self.v,
            input: &self.record.input,
            split: &self.split,
        }
    }

    /// Tangents of the piece.
    fn jvp(
        &self,
        state: &StateTangents,
        v: &DMatrix<f64>,
        inputs: &InputTangents,
    ) -> Result<StateTangents> {
        let (q, y) = (&state.q, &state.y);
        let along = StepTangents { q, y, v, inputs };
        self.derivatives.jvp(&self.start(), &along)
    }

    /// Transpose of the piece.
    fn vjp(&self, next_bar: &StateBar) -> Result<StepBar> {
        self.derivatives.vjp(&self.start(), next_bar)
    }

    /// Tangents of the velocity read out at its state.
    fn velocity_jvp(&self, state: &StateTangents, inputs: &InputTangents) -> Result<DMatrix<f64>> {
        let (s, e) = (&self.stepper, &self.e);
        let momentum = s.momentum_slopes(e, self.v, inputs.has_parameters())?;
        s.velocity_jvp(e, &self.state, momentum.as_ref(), state, inputs)
    }

    /// Carries the cotangent of the velocity read out at its state on to the state.
    fn carry(&self, bar: &mut StepBar) -> Result<()> {
        let v_bar = std::mem::replace(&mut bar.v, DVector::zeros(self.v.len()));
        self.stepper
            .velocity_vjp(&self.e, &self.state, self.v, &v_bar, bar)
    }
}

impl<'a> LinearisedStep<'_, 'a> {
    /// The system at the state before the step.
    pub fn linearisation(&self) -> &Linearisation<'a> {
        &self.first.e
    }

    /// What the step left behind.
    pub fn record(&self) -> &StepRecord {
        self.record
    }

    /// Transpose of [`Stepper::step`]: cotangents of the state (in q and y), of the velocity v read out there as far as it isn't carried on to the state already, of the control
    /// and of the parameters, from that of the next state.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn vjp(&self, next_bar: &StateBar) -> Result<StepBar> {
        let mut after: Option<StepBar> = None;
        for part in self.later.iter().rev() {
            let mut bar = through(part, after, next_bar)?;
            part.carry(&mut bar)?;
            after = Some(bar);
        }
        through(&self.first, after, next_bar)
    }

    /// The same with the velocity read out at the state: all that the next state's cotangent is worth at the state itself.
    ///
    /// # Errors
    /// As [`LinearisedStep::vjp`].
    pub fn state_vjp(&self, next_bar: &StateBar) -> Result<StepBar> {
        let mut bar = self.vjp(next_bar)?;
        self.first.carry(&mut bar)?;
        Ok(bar)
    }

    /// Tangents of [`Stepper::step`] along displacements of the state (q in its tangent space, y), with those of the velocity that is read out there,
    /// and of the inputs; many directions cost little more than one.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn jvp(
        &self,
        state: &StateTangents,
        v: &DMatrix<f64>,
        inputs: &InputTangents,
    ) -> Result<StateTangents> {
        let mut next = self.first.jvp(state, v, inputs)?;
        for part in &self.later {
            let v = part.velocity_jvp(&next, inputs)?;
            next = part.jvp(&next, &v, inputs)?;
        }
        Ok(next)
    }

    /// Tangents of the velocity read out at the state, along displacements of that and of the parameters.
    ///
    /// # Errors
    /// As [`LinearisedStep::jvp`].
    pub fn velocity_jvp(
        &self,
        state: &StateTangents,
        inputs: &InputTangents,
    ) -> Result<DMatrix<f64>> {
        self.first.velocity_jvp(state, inputs)
    }
}

/// Transpose of a piece, from what the pieces after it came to, or of the last one from the cotangent of the next state.
fn through(part: &Part, after: Option<StepBar>, next_bar: &StateBar) -> Result<StepBar> {
    let Some(after) = after else {
        return part.vjp(next_bar);
    };
    let mut bar = part.vjp(&after.state)?;
    bar.control += after.control;
    bar.parameters.add(&after.parameters);
    Ok(bar)
}
