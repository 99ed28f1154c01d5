//! What acts at the velocity that contact leaves: contact itself, and by how much forces that resist motion are others than at the velocity before it ([`crate::dynamics`]'s `resistance`).

use super::start::Start;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::dynamics::resistance::Resistance;
use crate::dynamics::slopes::unit;
use crate::dynamics::{Dual, Evaluation, ForceCotangents, Slopes};
use nalgebra::{DMatrix, DVector};

/// Where a problem of contact takes the forces that resist motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Resisting {
    /// Nowhere: they are part of what is solved before, and stay.
    No,
    /// At the configuration of a step's start.
    AtStart,
    /// Those of joints at that of its middle.
    InMiddle,
}

impl Resisting {
    /// How they are taken in a step; none where nothing resists.
    pub fn of<'r>(self, start: &Start<'r, '_>) -> Option<Resistance<'r>> {
        let middle = match self {
            Self::No => return None,
            Self::AtStart => None,
            Self::InMiddle => Some((start.v, 0.5 * start.stepper.dt)),
        };
        let resistance = Resistance {
            control: &start.input.control,
            middle,
        };
        (start.stepper.system.has_resistance()).then_some(resistance)
    }
}

/// G(v) = g(q, v) + R(q, v) − R(q, v*).
pub(super) struct Reaction<'r, 'a> {
    near: &'r Evaluation<'a>,
    before: &'r DVector<f64>,
    resistance: Option<Resistance<'r>>,
}

/// Transpose of it.
pub(super) struct ReactionBar {
    /// Of the configuration, the velocity, controls and parameters.
    pub force: ForceCotangents,
    /// Of the velocity before contact, and of the one at the step's start.
    pub before: DVector<f64>,
    pub start: DVector<f64>,
}

/// Derivatives of it.
pub(super) struct ReactionSlopes {
    pub force: Slopes,
    pub before: DMatrix<f64>,
    pub start: DMatrix<f64>,
}

impl<'r, 'a> Reaction<'r, 'a> {
    /// From the velocity before contact.
    pub fn new(start: &Start<'r, 'a>, before: &'r DVector<f64>, resisting: Resisting) -> Self {
        Self {
            near: start.near,
            before,
            resistance: resisting.of(start),
        }
    }

    /// G at the velocity `v`.
    pub fn force(&self, v: &DVector<f64>, dual: Dual) -> DVector<f64> {
        self.near.contact_force(v, dual) + self.resisted(v, dual)
    }

    fn resisted(&self, v: &DVector<f64>, dual: Dual) -> DVector<f64> {
        match &self.resistance {
            None => DVector::zeros(v.len()),
            Some(how) => {
                self.near.resistance(how, v, dual) - self.near.resistance(how, self.before, dual)
            }
        }
    }

    /// Sizes of what it sums.
    pub fn effort(&self, v: &DVector<f64>) -> DVector<f64> {
        let mut out = self.near.contact_effort(v);
        if self.resistance.is_some() {
            out += self.resisted(v, Dual::User).abs();
        }
        out
    }

    /// ∂R/∂v.
    pub fn resistance_matrix(&self, v: &DVector<f64>) -> Option<IslandMatrix> {
        let how = self.resistance.as_ref()?;
        Some(self.near.resistance_matrix(how, v))
    }

    /// Tangent of G (the user's coordinates) along `dv`.
    pub fn force_jvp(&self, v: &DVector<f64>, dv: &DVector<f64>) -> DVector<f64> {
        let mut out = self.near.contact_force_jvp(v, dv);
        if let Some(how) = &self.resistance {
            out += self.near.resistance_jvp(how, v, dv);
        }
        out
    }

    /// Transpose of [`Reaction::force`].
    pub fn force_vjp(&self, v: &DVector<f64>, z: &DVector<f64>, dual: Dual) -> ReactionBar {
        let mut force = self.near.contact_force_vjp(v, z, dual);
        let mut before = DVector::zeros(v.len());
        let mut start = DVector::zeros(v.len());
        if let Some(how) = &self.resistance {
            let after = self.near.resistance_vjp(how, v, z, dual);
            let had = self.near.resistance_vjp(how, self.before, z, dual);
            for (sign, bars) in [(1.0, &after), (-1.0, &had)] {
                force.q += sign * &bars.force.q;
                force.control += sign * &bars.force.control;
                (force.parameters).add_scaled(sign, &bars.force.parameters);
                start += sign * &bars.start;
            }
            force.v += &after.force.v;
            before -= &had.force.v;
        }
        ReactionBar {
            force,
            before,
            start,
        }
    }

    /// Derivatives of its entries `entries`; the others have none.
    pub fn slopes(&self, v: &DVector<f64>, dual: Dual, entries: &[usize]) -> ReactionSlopes {
        let n = v.len();
        let row = |i: &usize| self.force_vjp(v, &unit(n, *i), dual);
        let rows: Vec<_> = entries.iter().map(row).collect();
        let matrix = |of: &dyn Fn(&ReactionBar) -> &DVector<f64>| {
            let mut out = DMatrix::zeros(n, n);
            for (i, row) in entries.iter().zip(&rows) {
                out.row_mut(*i).tr_copy_from(of(row));
            }
            out
        };
        let (before, start) = (matrix(&|r| &r.before), matrix(&|r| &r.start));
        let zero = ForceCotangents::zeros(self.near);
        let rows: Vec<_> = rows.into_iter().map(|r| r.force).collect();
        ReactionSlopes {
            force: Slopes::from_rows(n, entries, &rows, &zero),
            before,
            start,
        }
    }
}
