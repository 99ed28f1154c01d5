//! The factor of an implicit stage's matrix on the free velocities.
//!
//! Of bodies so many that no matrix of them all is formed it is that of what each joint tree is alone, its drag and turning with it, which recoils in what others exchange
//! with it ([`Recoiling`]): all of the matrix but for how the exchange's own force changes with the velocity.

use super::rule::Rule;
use super::split::Split;
use super::stage_matrix::{excess, stage_matrix};
use super::start::Start;
use crate::Result;
use crate::dynamics::Linearisation;
use crate::dynamics::island_matrix::{IslandFactor, IslandMatrix};
use crate::dynamics::recoil::{Own, Recoiling};
use nalgebra::DVector;

/// Such a factor.
pub(super) enum StageFactor<'a> {
    /// Of all of it.
    Islands(IslandFactor),
    /// Of what trees are alone, and recoil; with the velocities that are free.
    Recoiling(Recoiling<'a>, Split),
}

/// What a stage's matrix is made from: all of it, or what trees are alone.
pub(super) struct StageMatrix<'e, 'a> {
    /// Where the stage is.
    e: &'e Linearisation<'a>,
    /// Trees alone, where no matrix of all bodies is formed.
    alone: Option<Linearisation<'a>>,
    /// ∂f/∂v, of `alone` where there is one.
    pub rates: IslandMatrix,
    /// What of its diagonal is of forces that are late, where some are.
    pub late: Option<DVector<f64>>,
}

impl<'e, 'a> StageMatrix<'e, 'a> {
    /// At the velocity `v`, of a step from `start`.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn new(
        start: &Start<'_, 'a>,
        e: &'e Linearisation<'a>,
        v: &DVector<f64>,
        rule: Rule,
    ) -> Result<Self> {
        let alone = e.alone()?;
        let control = &start.input.control;
        let mut rates = (alone.as_ref().unwrap_or(e)).force_velocity_blocks(v, control)?;
        let late = start.late(e, v, rule);
        let late = late.map(|late| e.late_rates(&late, control));
        if let Some(late) = &late {
            rates.subtract(late.iter().enumerate().map(|(i, x)| (i, i, -x)));
        }
        Ok(Self {
            e,
            alone,
            rates,
            late,
        })
    }

    fn at(&self) -> &Linearisation<'a> {
        self.alone.as_ref().unwrap_or(self.e)
    }

    /// How many times too long the step is for the stage, as far as `rates` tell; none where it isn't.
    pub fn excess(&self, split: &Split, v: &DVector<f64>, rule: Rule) -> Option<usize> {
        excess(self.at(), split, v, &self.rates, rule)
    }

    /// The matrix itself, with the momentum p̂ + h f.
    pub fn matrix(&self, v: &DVector<f64>, reached: &DVector<f64>, rule: Rule) -> IslandMatrix {
        let at = self.at();
        stage_matrix(at, at.mass_blocks(), v, &self.rates, reached, rule)
    }

    /// Its factor, or that of its transpose; none of a singular one.
    pub fn factored(
        &self,
        split: &Split,
        matrix: &IslandMatrix,
        transposed: bool,
    ) -> Option<StageFactor<'a>> {
        let factor = matrix.factored(&split.free, transposed);
        factor.solve(&DVector::zeros(split.free.len()))?;
        let Some(at) = self.e.scattered() else {
            return Some(StageFactor::Islands(factor));
        };
        let free = split.clone();
        let own = move |right: &DVector<f64>| {
            let found = factor.solve(&free.take(right));
            found.map_or_else(|| DVector::zeros(right.len()), |x| free.put(&x))
        };
        let many = Recoiling::new(self.e, at, Own::new(false, own));
        Some(StageFactor::Recoiling(many, split.clone()))
    }
}

impl StageFactor<'_> {
    /// x with A x = `b` on the free velocities, a change of the velocity `of`, if it is one; `None` of a singular matrix.
    pub fn solve(&self, b: &DVector<f64>, of: Option<&DVector<f64>>) -> Option<DVector<f64>> {
        match self {
            Self::Islands(factor) => factor.solve(b),
            Self::Recoiling(many, split) => Some(split.take(&many.change(&split.put(b), of))),
        }
    }
}
