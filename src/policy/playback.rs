//! Controls that were found before.

use super::{Action, ActionBar, Observation, Policy, expect};
use crate::Result;
use nalgebra::DVector;

/// Given controls, step by step; nothing after the last one. Gains: the controls of all steps in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Number of controls of the system.
    pub controls: usize,
    /// Controls of each step, N or N m.
    pub steps: Vec<Vec<f64>>,
}

impl Policy for Playback {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let control = self.steps.get(observed.step).cloned();
        Ok(Action::control(control.unwrap_or_default()))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let mut gains = vec![0.0; self.controls * self.steps.len()];
        if observed.step < self.steps.len() {
            let from = self.controls * observed.step;
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
        }))
    }
}
