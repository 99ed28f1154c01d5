//! What optimal control is to lower: a sum of terms at the knots of a horizon, each with its gradient and a Hessian that isn't negative.
//!
//! Terms are `Σ weight · residual²`: of configurations (their difference, so that rotations need no chart), velocities, controls, changes of controls from knot to knot,
//! positions and orientations of bodies and sites, and entries of any observable with derivatives. Their Hessians are those of Gauss and Newton, 2 JᵀWJ; a [`CustomCost`]
//! brings its own. A *running* term is integrated over time: at every knot but the last it counts its value times the duration of the knot, so that weights don't change with
//! the number of knots. A *last* term counts once, at the end.
//!
//! A target may stand or move ([`Target`]): a table in the simulation's time.

mod bound;
mod custom;
mod motion;
mod target;
mod term;

pub(super) use bound::{Bound, Sizes};
pub use custom::{CostPoint, CustomCost, Quadratic};
pub use target::Target;
pub use term::{Term, Weights, terms};

use crate::Result;
use crate::simulate::Simulator;

/// A sum of terms.
///
/// ```
/// use hydrograd::optimize::{Cost, terms};
///
/// let cost = Cost::default()
///     .running(terms::position("hand", [0.5, 0.0, -1.0], 10.0))
///     .running(terms::effort(1e-3))
///     .last(terms::velocity(vec![0.0; 7], 1.0));
/// ```
#[derive(Clone, Default)]
pub struct Cost {
    running: Vec<Term>,
    last: Vec<Term>,
}

impl Cost {
    /// With another term that is integrated over time.
    pub fn running(mut self, term: Term) -> Self {
        self.running.push(term);
        self
    }

    /// Whether it has no terms.
    pub fn is_empty(&self) -> bool {
        self.running.is_empty() && self.last.is_empty()
    }

    /// With another term at the end.
    pub fn last(mut self, term: Term) -> Self {
        self.last.push(term);
        self
    }

    /// Made ready for a simulator.
    ///
    /// # Errors
    /// Names of frames or observables that the scene doesn't have, targets and weights of wrong lengths or not finite, negative weights, a last term of the controls.
    pub(super) fn bind(&self, simulator: &Simulator) -> Result<Bound> {
        let sizes = Sizes::of(simulator);
        let each = |terms: &[Term], last: bool| -> Result<Vec<_>> {
            let bound = terms.iter().enumerate();
            bound
                .map(|(i, term)| {
                    let list = if last { "last" } else { "running" };
                    let place = format!("cost: {list} term {i} ({})", term.name());
                    term.bind(simulator, &place, last)
                })
                .collect()
        };
        let (running, last) = (each(&self.running, false)?, each(&self.last, true)?);
        Ok(Bound::new(sizes, running, last))
    }
}
