//! Controllers: what acts, from what is observed, with its transpose.

mod pd;
mod playback;
mod push;
mod stages;
mod wave;

pub use pd::{Pd, PdAxis};
pub use playback::Playback;
pub use push::PushThenLock;
pub use stages::{SpeedStage, SpeedStages};
pub use wave::{Wave, WaveJoint};

use crate::{Error, Result};
use nalgebra::DVector;

/// Part of a step by which rounding may move a time.
const ROUNDING: f64 = 1e-6;

/// How many time steps (s) a clock has made that started a time (s) ago, a whole number; negative before it starts.
#[cfg(feature = "opt")]
pub(crate) fn steps_at(time: f64, time_step: f64) -> f64 {
    (time / time_step + ROUNDING).floor()
}

/// What a controller sees at the start of a step.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Number of steps made.
    pub step: usize,
    /// Time, s.
    pub time: f64,
    /// How long the step is, s.
    pub time_step: f64,
    /// Joint coordinates.
    pub q: &'a DVector<f64>,
    /// Generalised velocity.
    pub v: &'a DVector<f64>,
    /// What [`Action::mode`] was at the step before; 0 at the first.
    pub mode: usize,
}

/// What a controller does during the step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Action {
    /// Added to the open-loop controls; empty: nothing.
    pub control: Vec<f64>,
    /// Bodies whose joints are held; empty: none.
    pub hold: Vec<bool>,
    /// What the controller remembers: it sees it again at the next step, as [`Observation::mode`].
    pub mode: usize,
}

impl Action {
    /// These controls alone.
    fn control(control: Vec<f64>) -> Self {
        Self {
            control,
            ..Self::default()
        }
    }
}

/// Cotangents of [`Policy::act`]'s inputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionBar {
    /// Tangent cotangent of q, length nv; empty: zero.
    pub q: Vec<f64>,
    /// Cotangent of v; empty: zero.
    pub v: Vec<f64>,
    /// Cotangent of the gains.
    pub gains: Vec<f64>,
}

impl ActionBar {
    /// Of a controller that sees nothing.
    fn gains(gains: Vec<f64>) -> Self {
        Self {
            gains,
            ..Self::default()
        }
    }
}

/// A controller. A pure function of what it observes, so that a rollout can be replayed; what it must remember
/// (a phase, a switch that doesn't go back) it hands to itself as a mode.
///
/// Controllers with switches (if, lock) are differentiable between them: the gradient is that of the
/// branch that was taken, at the step at which it was taken. How the *moment* of a switch moves with the
/// inputs is not seen: it moves in whole steps, so the trajectory jumps by what one step at the
/// switch is worth, and the gradient holds between two such jumps.
pub trait Policy: Send + Sync {
    /// The action at an observation.
    ///
    /// # Errors
    /// Whatever keeps it from acting ([`Error::Controller`] for a reason of its own): the run ends with that.
    fn act(&self, observed: &Observation) -> Result<Action>;

    /// Transpose of [`Policy::act`] for the cotangent of its control.
    ///
    /// # Errors
    /// As [`Policy::act`].
    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar>;

    /// Adjustable gains.
    fn gains(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The same controller with other gains.
    ///
    /// # Errors
    /// A wrong number of gains.
    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>>;
}

/// No feedback: only the open-loop controls.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenLoop;

fn expect(count: usize, gains: &[f64]) -> Result<()> {
    if gains.len() == count {
        return Ok(());
    }
    Err(Error::input(
        "controller: gains",
        format!("{} numbers", gains.len()),
        format!("must be {count} numbers"),
    ))
}

impl Policy for OpenLoop {
    fn act(&self, _: &Observation) -> Result<Action> {
        Ok(Action::default())
    }

    fn act_vjp(&self, _: &Observation, _: &DVector<f64>) -> Result<ActionBar> {
        Ok(ActionBar::default())
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(0, gains)?;
        Ok(Box::new(*self))
    }
}

/// Constant controls as gains.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Controls, N or N m.
    pub control: Vec<f64>,
}

impl Policy for Constant {
    fn act(&self, _: &Observation) -> Result<Action> {
        Ok(Action::control(self.control.clone()))
    }

    fn act_vjp(&self, _: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        Ok(ActionBar::gains(control_bar.as_slice().to_vec()))
    }

    fn gains(&self) -> Vec<f64> {
        self.control.clone()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(self.control.len(), gains)?;
        Ok(Box::new(Self {
            control: gains.to_vec(),
        }))
    }
}
