//! What is known at some poses: answers, and what solves cost.

use crate::Error;
use crate::coupling::CouplingReport;
use nalgebra::DVector;
use std::ops::Deref;
use std::sync::Arc;

/// Answers kept: those to the velocity, to a virtual one and to what is driven, at both ends of a pair, and a few steps from one velocity to the next.
const KEPT: usize = 10;

/// What all bodies are in the water as they move.
#[derive(Clone, Debug)]
pub struct Answer {
    /// α, all points: they follow from the rest.
    pub charges: Vec<f64>,
    /// What is kept of it beyond its poses.
    pub(super) told: Arc<Told>,
}

/// An answer but for its charges.
#[derive(Clone, Debug)]
pub struct Told {
    /// Body-frame twists, 6 a body.
    pub twists: DVector<f64>,
    /// 4π Ūᵀ Ĝ α and what films have, body-frame impulses at unit density that the others add to each body's own.
    pub exchanged: DVector<f64>,
    /// The twists that modes and charges were solved for: the same but for what a solve leaves open.
    pub(super) solved: DVector<f64>,
    pub(super) modes: Vec<f64>,
    /// a − Lᵀ Ĝ α of the modes.
    pub(super) left: Vec<f64>,
}

impl Deref for Answer {
    type Target = Told;

    fn deref(&self) -> &Told {
        &self.told
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
    /// The first of what must be above zero and isn't, in words, with its value.
    pub negative: Option<(&'static str, f64)>,
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
    pub fn told(&self, twists: &DVector<f64>) -> Option<Arc<Told>> {
        let found = self.answers.iter().find(|a| a.twists == *twists)?;
        Some(found.told.clone())
    }

    /// Keeps an answer, the oldest of many making room.
    pub fn keep(&mut self, answer: Arc<Answer>) {
        if self.answers.len() >= KEPT {
            self.answers.remove(0);
        }
        self.answers.push(answer);
    }
}
