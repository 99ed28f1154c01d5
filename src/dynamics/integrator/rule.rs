//! The rule by which an implicit stage is made: over which time its force acts, and how far its chart reaches.

use crate::dynamics::{Drift, Linearisation};
use nalgebra::DVector;

/// An implicit stage: `M v + p_rest = J(ξ)ᵀ X(q ⊕ ξ)ᵀ (p̂ + h f(q, v, u))` with ξ = reach v; h (1 − h D) for h where the stage has a configuration of its own,
/// before which bodies have drifted for the time h ([`crate::dynamics::Drift`]).
#[derive(Clone, Copy)]
pub(super) struct Rule {
    /// Time over which the force acts, s.
    pub h: f64,
    /// Time over which the chart reaches out, s: the step's for Euler; zero where q is the stage's own.
    pub reach: f64,
}

impl Rule {
    /// Whether the stage has a configuration of its own, in the middle of the step.
    pub fn is_middle(&self) -> bool {
        self.reach == 0.0
    }

    /// What a force adds to the momentum.
    pub fn impulse(&self, e: &Linearisation, force: &DVector<f64>) -> DVector<f64> {
        self.drifted(e, force, |drift, x| drift.carry(-self.h, x))
    }

    /// Transpose of [`Rule::impulse`].
    pub fn impulse_back(&self, e: &Linearisation, bar: &DVector<f64>) -> DVector<f64> {
        self.drifted(e, bar, |drift, x| drift.carry_back(-self.h, x))
    }

    fn drifted(
        &self,
        e: &Linearisation,
        x: &DVector<f64>,
        carry: impl Fn(&Drift, DVector<f64>) -> DVector<f64>,
    ) -> DVector<f64> {
        let x = self.h * x;
        match self.is_middle() {
            true => carry(&e.system.drift, x),
            false => x,
        }
    }
}
