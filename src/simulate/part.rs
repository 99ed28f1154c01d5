//! Parts of a long run, and scalars that are sums over them.

use super::{Cotangents, Rollout};
use crate::Result;
use std::ops::Range;

/// A part of a long run.
pub struct Part<'r> {
    /// The part as a rollout of its own: its first state is number `first` of the run.
    pub rollout: &'r Rollout,
    /// Number of its first step in the run.
    pub first: usize,
    /// Steps of the whole run.
    pub steps: usize,
}

impl Part<'_> {
    /// Whether the run ends with it.
    pub fn is_last(&self) -> bool {
        self.first + self.rollout.steps() == self.steps
    }

    /// States of its rollout that are its own: all but the last one, which belongs to the next part.
    pub fn states(&self) -> Range<usize> {
        0..self.rollout.steps() + usize::from(self.is_last())
    }
}

/// A scalar of a run that is a sum over its parts.
pub trait Partwise {
    /// What a part adds to its value, and its derivatives with respect to what is observed in the part. Cotangents of a state that isn't the part's own
    /// ([`Part::states`]) aren't read.
    ///
    /// # Errors
    /// What doesn't fit the scene, and what would.
    fn part(&self, part: &Part) -> Result<(f64, Cotangents)>;
}
