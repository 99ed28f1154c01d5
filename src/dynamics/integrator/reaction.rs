//! What acts at the velocity that contact leaves: contact itself, and by how much forces that resist motion are others than at the velocity before it ([`crate::dynamics`]'s `resistance`).

use super::StepTangents;
use super::start::Start;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::dynamics::resistance::Resistance;
use crate::dynamics::slopes::unit;
use crate::dynamics::{Dual, Evaluation, ForceCotangents, Slopes};
use nalgebra::{DMatrix, DVector};
use std::cell::OnceCell;

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

/// R(q, v) − R(q, v*), of a problem in which something resists.
pub(super) struct Resisted<'r, 'a> {
    near: &'r Evaluation<'a>,
    before: &'r DVector<f64>,
    how: Resistance<'r>,
    /// R(q, v*), in the user's coordinates and in the frame's.
    had: [OnceCell<DVector<f64>>; 2],
}

/// G(v) = g(q, v) + R(q, v) − R(q, v*).
pub(super) struct Reaction<'r, 'a> {
    near: &'r Evaluation<'a>,
    resisted: Option<Resisted<'r, 'a>>,
}

/// Transpose of either.
pub(super) struct ReactionBar {
    /// Of the configuration, the velocity, controls and parameters.
    pub force: ForceCotangents,
    /// Of the velocity before contact, and of the one at the step's start.
    pub before: DVector<f64>,
    pub start: DVector<f64>,
}

/// Derivatives of either.
pub(super) struct ReactionSlopes {
    force: Slopes,
    before: DMatrix<f64>,
    start: DMatrix<f64>,
}

impl<'r, 'a> Resisted<'r, 'a> {
    /// From the velocity before contact; none where nothing resists, or a problem doesn't hold it.
    pub fn new(
        start: &Start<'r, 'a>,
        before: &'r DVector<f64>,
        resisting: Resisting,
    ) -> Option<Self> {
        Some(Self {
            near: start.near,
            before,
            how: resisting.of(start)?,
            had: Default::default(),
        })
    }

    /// At the velocity `v`.
    pub fn force(&self, v: &DVector<f64>, dual: Dual) -> DVector<f64> {
        let of = |v| self.near.resistance(&self.how, v, dual);
        let had = match dual {
            Dual::User => &self.had[0],
            Dual::Frame => &self.had[1],
        };
        of(v) - had.get_or_init(|| of(self.before))
    }

    /// Transpose of [`Resisted::force`].
    pub fn force_vjp(&self, v: &DVector<f64>, z: &DVector<f64>, dual: Dual) -> ReactionBar {
        let of = |v| self.near.resistance_vjp(&self.how, v, z, dual);
        let (left, had) = (of(v), of(self.before));
        let mut force = left.force;
        force.q -= had.force.q;
        force.control -= had.force.control;
        (force.parameters).add_scaled(-1.0, &had.force.parameters);
        ReactionBar {
            force,
            before: -had.force.v,
            start: left.start - had.start,
        }
    }

    /// Derivatives of all its entries.
    pub fn slopes(&self, v: &DVector<f64>, dual: Dual) -> ReactionSlopes {
        let entries: Vec<usize> = (0..v.len()).collect();
        ReactionSlopes::new(self.near, &entries, |z| self.force_vjp(v, z, dual))
    }
}

impl<'r, 'a> Reaction<'r, 'a> {
    /// From the velocity before contact.
    pub fn new(start: &Start<'r, 'a>, before: &'r DVector<f64>, resisting: Resisting) -> Self {
        Self {
            near: start.near,
            resisted: Resisted::new(start, before, resisting),
        }
    }

    /// G at the velocity `v`.
    pub fn force(&self, v: &DVector<f64>, dual: Dual) -> DVector<f64> {
        let mut out = self.near.contact_force(v, dual);
        if let Some(resisted) = &self.resisted {
            out += resisted.force(v, dual);
        }
        out
    }

    /// The same in the user's coordinates, and the sizes of what it sums.
    pub fn force_and_effort(&self, v: &DVector<f64>) -> [DVector<f64>; 2] {
        let mut force = self.near.contact_force(v, Dual::User);
        let mut effort = self.near.contact_effort(v);
        if let Some(resisted) = &self.resisted {
            let resisted = resisted.force(v, Dual::User);
            effort += resisted.abs();
            force += resisted;
        }
        [force, effort]
    }

    /// ∂R/∂v.
    pub fn resistance_matrix(&self, v: &DVector<f64>) -> Option<IslandMatrix> {
        let resisted = self.resisted.as_ref()?;
        Some(self.near.resistance_matrix(&resisted.how, v))
    }

    /// Tangent of G (the user's coordinates) along `dv`.
    pub fn force_jvp(&self, v: &DVector<f64>, dv: &DVector<f64>) -> DVector<f64> {
        let mut out = self.near.contact_force_jvp(v, dv);
        if let Some(resisted) = &self.resisted {
            out += self.near.resistance_jvp(&resisted.how, v, dv);
        }
        out
    }

    /// Transpose of [`Reaction::force`].
    pub fn force_vjp(&self, v: &DVector<f64>, z: &DVector<f64>, dual: Dual) -> ReactionBar {
        let own = self.near.contact_force_vjp(v, z, dual);
        let Some(resisted) = &self.resisted else {
            let none = || DVector::zeros(v.len());
            return ReactionBar {
                force: own,
                before: none(),
                start: none(),
            };
        };
        let mut out = resisted.force_vjp(v, z, dual);
        out.force.q += own.q;
        out.force.v += own.v;
        out.force.control += own.control;
        out.force.parameters.add(&own.parameters);
        out
    }

    /// Derivatives of its entries `entries`; the others have none.
    pub fn slopes(&self, v: &DVector<f64>, dual: Dual, entries: &[usize]) -> ReactionSlopes {
        ReactionSlopes::new(self.near, entries, |z| self.force_vjp(v, z, dual))
    }
}

impl ReactionSlopes {
    /// From the transpose.
    fn new(
        near: &Evaluation,
        entries: &[usize],
        vjp: impl Fn(&DVector<f64>) -> ReactionBar,
    ) -> Self {
        let n = near.system.tree.velocities();
        let rows: Vec<_> = entries.iter().map(|i| vjp(&unit(n, *i))).collect();
        let matrix = |of: &dyn Fn(&ReactionBar) -> &DVector<f64>| {
            let mut out = DMatrix::zeros(n, n);
            for (i, row) in entries.iter().zip(&rows) {
                out.row_mut(*i).tr_copy_from(of(row));
            }
            out
        };
        let (before, start) = (matrix(&|r| &r.before), matrix(&|r| &r.start));
        let zero = ForceCotangents::zeros(near);
        let rows: Vec<_> = rows.into_iter().map(|r| r.force).collect();
        Self {
            force: Slopes::from_rows(n, entries, &rows, &zero),
            before,
            start,
        }
    }

    /// Tangents along those of a step's start, of the velocity before contact, and of the velocity itself if it changes.
    pub fn along(
        &self,
        along: &StepTangents,
        before: &DMatrix<f64>,
        v: Option<&DMatrix<f64>>,
    ) -> DMatrix<f64> {
        (self.force).along(along.q, v, along.inputs) + &self.before * before + &self.start * along.v
    }
}
