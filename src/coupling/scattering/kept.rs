//! What is known at some poses: answers, and what solves cost.

use crate::Error;
use crate::coupling::CouplingReport;
use nalgebra::DVector;
use std::sync::Arc;

/// Answers kept: those to the velocity, to a virtual one and to what is driven, at both ends of a pair, and a few steps from one velocity to the next.
const KEPT: usize = 10;

/// What all bodies are in the water as they move.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Body-frame twists, 6 a body.
    pub twists: DVector<f64>,
    /// α, all points.
    pub charges: Vec<f64>,
    /// 4π Ūᵀ Ĝ α, body-frame impulses at unit density that the others add to each body's own.
    pub exchanged: DVector<f64>,
    /// The twists that modes and charges were solved for: the same but for what a solve leaves open.
    pub(super) solved: DVector<f64>,
    pub(super) modes: Vec<f64>,
    /// a − Lᵀ Ĝ α of the modes.
    pub(super) left: Vec<f64>,
}

/// All of it.
#[derive(Default)]
pub(super) struct Kept {
    pub answers: Vec<Arc<Answer>>,
    pub report: CouplingReport,
    /// Iterations and residual of the first solve that missed its tolerance.
    pub failed: Option<(usize, f64)>,
    /// Why sums that are made elsewhere weren't; told once.
    pub lost: Option<Error>,
}

impl Kept {
    /// The answer to these twists, if it is kept: the last to make room.
    pub fn found(&mut self, twists: &DVector<f64>) -> Option<Arc<Answer>> {
        let place = self.answers.iter().position(|a| a.twists == *twists)?;
        let found = self.answers.remove(place);
        self.answers.push(found.clone());
        Some(found)
    }

    /// Keeps an answer, the oldest of many making room.
    pub fn keep(&mut self, answer: Arc<Answer>) {
        if self.answers.len() >= KEPT {
            self.answers.remove(0);
        }
        self.answers.push(answer);
    }
}
