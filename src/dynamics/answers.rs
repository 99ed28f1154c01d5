//! What the water answered to velocities: kept of a step, so that its derivatives needn't solve for it again.

use super::{Evaluation, System};
use crate::coupling::scattering::Told;
use nalgebra::DVector;
use std::sync::Arc;

/// Answers at one configuration, where many bodies are coupled by products; none elsewhere.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers(Vec<Arc<Told>>);

impl Evaluation<'_> {
    /// The answers that are known to velocities.
    pub(super) fn answers<'v>(&self, all: impl IntoIterator<Item = &'v DVector<f64>>) -> Answers {
        let Some(at) = self.scattered() else {
            return Answers::default();
        };
        let twists = |v| at.motions().twists(&self.through_water(v));
        let mut out: Vec<Arc<Told>> = Vec::new();
        for twists in all.into_iter().map(twists) {
            if !out.iter().any(|told| told.twists == twists) {
                out.extend(at.told_of(&twists));
            }
        }
        Answers(out)
    }

    /// Begins to look for a velocity from what the water answers to `v` at another configuration, which is near.
    pub(super) fn begin_near(&self, other: &Self, v: &DVector<f64>) {
        let (Some(here), Some(there)) = (self.scattered(), other.scattered()) else {
            return;
        };
        let v = self.virtual_direction(v);
        if let Some(told) = there.told_of(&there.motions().twists(&v)) {
            here.begin_near(&told, here.motions().twists(&v));
        }
    }

    /// Knows answers from here again.
    pub(super) fn recall(&self, answers: &Answers) {
        if let Some(at) = self.scattered() {
            answers.0.iter().for_each(|told| at.recall(told));
        }
    }
}

impl System {
    /// Numbers that the answer to one velocity takes.
    pub(crate) fn answer_numbers(&self) -> usize {
        let many = self.coupling.scattering();
        many.map_or(0, |many| many.told_numbers())
    }
}
