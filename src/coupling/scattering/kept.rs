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

/// An answer but for its charges, which follow from the rest: what is kept of it beyond its poses.
#[derive(Clone, Debug)]
pub struct Told {
    twists: DVector<f64>,
    exchanged: DVector<f64>,
    solved: DVector<f64>,
    modes: Vec<f64>,
    left: Vec<f64>,
}

impl Told {
    /// Body-frame twists, 6 a body.
    pub fn twists(&self) -> &DVector<f64> {
        &self.twists
    }

    pub(super) fn modes(&self) -> &[f64] {
        &self.modes
    }
}

impl Answer {
    /// What is kept of it.
    fn told(&self) -> Told {
        Told {
            twists: self.twists.clone(),
            exchanged: self.exchanged.clone(),
            solved: self.solved.clone(),
            modes: self.modes.clone(),
            left: self.left.clone(),
        }
    }

    /// With charges that follow from the rest.
    pub(super) fn again(told: Told, charges: Vec<f64>) -> Self {
        let Told {
            twists,
            exchanged,
            solved,
            modes,
            left,
        } = told;
        Self {
            twists,
            charges,
            exchanged,
            solved,
            modes,
            left,
        }
    }
}

/// Body-frame twists and modes that are near those asked for.
pub(super) struct Near {
    pub twists: DVector<f64>,
    pub modes: Vec<f64>,
}

/// All of it.
#[derive(Default)]
pub(super) struct Kept {
    pub answers: Vec<Arc<Answer>>,
    pub report: CouplingReport,
    /// Iterations and residual of the first solve that missed its tolerance.
    pub failed: Option<(usize, f64)>,
    /// What the first to recoil begins from.
    pub near: Option<Near>,
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

    /// What is told of these twists.
    pub fn told(&self, twists: &DVector<f64>) -> Option<Told> {
        let found = self.answers.iter().find(|a| a.twists == *twists)?;
        Some(found.told())
    }

    /// Keeps an answer, the oldest of many making room.
    pub fn keep(&mut self, answer: Arc<Answer>) {
        if self.answers.len() >= KEPT {
            self.answers.remove(0);
        }
        self.answers.push(answer);
    }
}
