//! A push that ends in a lock.

use super::{Action, ActionBar, Observation, Policy, expect};
use crate::Result;
use nalgebra::DVector;

/// Pushes one joint until its coordinate passes a value, then stops it within one step and holds it: the
/// paper's falling ball. Its gain is the force; see [`Policy`] for what the switch does to a gradient.
#[derive(Clone, Debug)]
pub struct PushThenLock {
    /// Number of controls of the system.
    pub controls: usize,
    /// Number of bodies.
    pub bodies: usize,
    /// The body.
    pub body: usize,
    /// Its control.
    pub control: usize,
    /// Its coordinate.
    pub q: usize,
    /// Force, N or N m.
    pub force: f64,
    /// Coordinate at which it stops.
    pub stop_at: f64,
    /// Whether the coordinate comes from above.
    pub from_above: bool,
}

impl PushThenLock {
    fn stopped(&self, observed: &Observation) -> bool {
        let x = observed.q[self.q];
        if self.from_above {
            x < self.stop_at
        } else {
            x > self.stop_at
        }
    }
}

impl Policy for PushThenLock {
    fn act(&self, observed: &Observation) -> Result<Action> {
        if self.stopped(observed) {
            let mut hold = vec![false; self.bodies];
            hold[self.body] = true;
            return Ok(Action {
                hold,
                ..Action::default()
            });
        }
        let mut control = vec![0.0; self.controls];
        control[self.control] = self.force;
        Ok(Action::control(control))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let gain = if self.stopped(observed) {
            0.0
        } else {
            control_bar[self.control]
        };
        Ok(ActionBar::gains(vec![gain]))
    }

    fn gains(&self) -> Vec<f64> {
        vec![self.force]
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(1, gains)?;
        Ok(Box::new(Self {
            force: gains[0],
            ..self.clone()
        }))
    }
}
