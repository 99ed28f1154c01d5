//! Controls that were found before.

use super::{Action, ActionBar, Observation, Policy, ROUNDING, expect};
use crate::Result;
use nalgebra::DVector;

/// Given controls, each for as long as a step; nothing after the last one. What runs with other steps is given the mean of what was meant for each of its steps: a step within a
/// row has that row, one over several rows all of them for as long as each lasts, and nothing for what lies beyond the last. Gains: the controls of all rows in turn.
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
    /// The rows that a step goes over, each with its part of the step.
    fn rows(&self, observed: &Observation) -> Vec<(usize, f64)> {
        let length = observed.time_step / self.time_step;
        // Whole but for rounding is whole.
        let whole = |rows: f64| match (rows - rows.round()).abs() < ROUNDING * length.min(1.0) {
            true => rows.round(),
            false => rows,
        };
        let begin = whole(observed.time / self.time_step);
        let end = whole(begin + length);
        let last = end.ceil().min(self.steps.len() as f64) as usize;
        let part = |row: usize| {
            let (from, to) = (row as f64, row as f64 + 1.0);
            (row, (end.min(to) - begin.max(from)) / (end - begin))
        };
        (begin.floor() as usize..last).map(part).collect()
    }
}

impl Policy for Playback {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let mut control = vec![0.0; self.controls];
        for (row, part) in self.rows(observed) {
            for (u, given) in control.iter_mut().zip(&self.steps[row]) {
                *u += part * given;
            }
        }
        Ok(Action::control(control))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let mut gains = vec![0.0; self.controls * self.steps.len()];
        for (row, part) in self.rows(observed) {
            let own = gains[self.controls * row..].iter_mut().zip(control_bar);
            own.for_each(|(gain, bar)| *gain = part * bar);
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
