//! Controls that were found before.

use super::{Action, ActionBar, Observation, Policy, expect, steps_at};
use crate::Result;
use nalgebra::DVector;

/// Given controls, each for as long as a step; nothing after the last one. What runs with shorter or longer steps is given what was meant for the time at which each
/// of its steps begins. Gains: the controls of all rows in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Number of controls of the system.
    pub controls: usize,
    /// Controls of each step, N or N m.
    pub steps: Vec<Vec<f64>>,
    /// How long each lasts, s.
    pub time_step: f64,
}

impl Playback {
    /// Which controls are those of a time.
    fn row(&self, time: f64) -> usize {
        steps_at(time, self.time_step) as usize
    }
}

impl Policy for Playback {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let control = self.steps.get(self.row(observed.time)).cloned();
        Ok(Action::control(control.unwrap_or_default()))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let mut gains = vec![0.0; self.controls * self.steps.len()];
        let row = self.row(observed.time);
        if row < self.steps.len() {
            let from = self.controls * row;
            gains[from..from + self.controls].copy_from_slice(control_bar.as_slice());
        }
        Ok(ActionBar::gains(gains))
    }

    fn gains(&self) -> Vec<f64> {
        self.steps.concat()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(self.controls * self.steps.len(), gains)?;
        let steps = gains.chunks(self.controls.max(1)).map(<[f64]>::to_vec);
        Ok(Box::new(Self {
            controls: self.controls,
            steps: steps.collect(),
            time_step: self.time_step,
        }))
    }
}
