//! Which states of a run are written.

use crate::simulate::Rollout;
use crate::{Error, Result};

/// Which states of a run are written: the first, then one after each so many, and the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frames {
    /// As many as there are up to so many in a second of simulated time.
    PerSecond(f64),
    /// Every n-th state.
    Every(usize),
}

impl Default for Frames {
    /// 30 a second.
    fn default() -> Self {
        Self::PerSecond(30.0)
    }
}

/// Steps that are no more than this part short of a frame's time have reached it: rounding of their quotient.
const ROUNDING: f64 = 1e-9;

impl Frames {
    /// Refuses what selects nothing.
    ///
    /// # Errors
    /// Frames a second that aren't finite and positive; every 0-th state.
    pub fn check(&self) -> Result<()> {
        match *self {
            Self::PerSecond(rate) if !(rate.is_finite() && rate > 0.0) => Err(Error::input(
                "output: frames per second",
                rate,
                "must be finite and positive",
            )),
            Self::Every(0) => Err(Error::input(
                "output: every",
                0,
                "must be at least 1, which takes every state",
            )),
            _ => Ok(()),
        }
    }

    /// Numbers of the states of a rollout that these are, rising; its first and its last are among them.
    ///
    /// # Errors
    /// As [`Frames::check`].
    pub fn states(&self, rollout: &Rollout) -> Result<Vec<usize>> {
        self.check()?;
        let every = match *self {
            Self::PerSecond(rate) => {
                let steps = 1.0 / (rate * rollout.simulator().time_step());
                (steps * (1.0 - ROUNDING)).ceil().max(1.0) as usize
            }
            Self::Every(every) => every,
        };
        let last = rollout.steps();
        let mut states: Vec<usize> = (0..last).step_by(every).collect();
        states.push(last);
        Ok(states)
    }
}
