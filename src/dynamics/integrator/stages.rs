//! What is kept of a step's stages, and what the derivatives of a step are asked for.

use super::start::Start;
use super::{StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::answers::Answers;
use nalgebra::DVector;

/// Velocities of a step that solves contact at its end.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactVelocities {
    /// With which the step would end without contact.
    pub before: DVector<f64>,
    /// By which it moves.
    pub after: DVector<f64>,
    /// That at its end, where that isn't the one it moves by.
    pub end: Option<DVector<f64>>,
    /// That by which contact bears something already at the step's start, where it does.
    pub held: Option<DVector<f64>>,
}

impl ContactVelocities {
    /// Before and after contact, of a step that ends with the velocity by which it moves.
    pub(super) fn new(before: DVector<f64>, after: DVector<f64>) -> Self {
        Self {
            before,
            after,
            end: None,
            held: None,
        }
    }

    /// With which contacts act.
    pub fn acting(&self) -> &DVector<f64> {
        self.end.as_ref().unwrap_or(&self.after)
    }
}

/// Nodes and weights of a method; stage i starts from stage i − 1 over `nodes[i]` of the step.
#[derive(Debug)]
pub(super) struct Tableau {
    pub nodes: &'static [f64],
    pub weights: &'static [f64],
}

impl Tableau {
    /// What a step of length `dt` comes to, from where it starts and the rates of the stages.
    pub fn sum<'r>(
        &self,
        dt: f64,
        mut from: DVector<f64>,
        rates: impl Iterator<Item = &'r DVector<f64>>,
    ) -> DVector<f64> {
        for (rate, weight) in rates.zip(self.weights) {
            from += *weight * dt * rate;
        }
        from
    }
}

/// What is kept of a step: its method, and the forces of all stages from which others start.
#[derive(Clone, Debug)]
pub(super) struct Forces {
    pub tableau: &'static Tableau,
    pub all: Vec<DVector<f64>>,
    /// Of every stage after the first what the water answered, and the velocity.
    pub known: Vec<(DVector<f64>, Answers)>,
}

/// What is kept of a step's stages.
#[derive(Clone, Debug)]
pub(super) enum Stages {
    /// Of integrators that solve contact.
    Contact(ContactVelocities),
    /// Of midpoint where surfaces press: those of momentum Euler.
    Touching(ContactVelocities),
    RungeKutta(Forces),
}

impl Stages {
    /// Velocities before and after contact; none of integrators that don't solve it.
    pub fn contact_velocities(&self) -> Option<&ContactVelocities> {
        match self {
            Self::Contact(velocities) | Self::Touching(velocities) => Some(velocities),
            Self::RungeKutta(_) => None,
        }
    }
}

/// What a step's derivatives need beside its start.
pub(super) trait StepDerivatives<'a>: Send + Sync {
    /// Tangents of the state after the step.
    fn jvp(&self, start: &Start<'_, 'a>, along: &StepTangents) -> Result<StateTangents>;

    /// Transpose of the step.
    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar>;
}
