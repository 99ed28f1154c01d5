//! What each body sees of the others: their charges, and the rates of these as all move.

use super::Reduced;
use super::linearised::ReducedLinearised;
use crate::Result;
use crate::coupling::film::MovingFilms;
use crate::coupling::surface::{Charges, Motion, Seen, held_apart};
use crate::solver::Columns;
use nalgebra::DVector;

impl Reduced {
    /// Solved for the twists of a motion and their rates.
    ///
    /// # Errors
    /// Films that hold bodies apart, and as without them.
    pub(super) fn solved_apart(&self, motion: &Motion) -> Result<ReducedLinearised<'_>> {
        let solved = ReducedLinearised::new(self, motion.poses, &motion.columns())?;
        match solved.films.any() {
            true => Err(held_apart()),
            false => Ok(solved),
        }
    }
}

impl ReducedLinearised<'_> {
    /// All charges, and their rates with what the displacement adds: two columns.
    pub(super) fn with_rates(&self, displaced: &DVector<f64>) -> Columns {
        Columns::from_fn(displaced.len(), 2, |j, k| match k {
            0 => self.alpha[(j, 0)],
            _ => self.alpha[(j, 1)] + displaced[j],
        })
    }

    /// The charges of the first of two columns, with their rates where the second has the rates of the twists and bodies are displaced as they move; and who
    /// sees them.
    pub(super) fn charges_seen(
        &self,
        motion: &Motion,
        films: &MovingFilms,
    ) -> (Vec<Charges<'_>>, Vec<Seen>) {
        let z = motion.displacement;
        let (psi, kept) = self.tangent_potentials(&[self.alpha.column(0).as_slice()], z, films);
        let (displaced, _) = self.tangent_solution(&psi);
        let displaced = displaced.column(0).into_owned();
        let strengths = self.with_rates(&displaced);
        let charges = self
            .reduced
            .bodies
            .iter()
            .enumerate()
            .map(|(b, body)| Charges {
                points: &body.parts().points,
                strengths: strengths.part(&self.range(b)),
            });
        let seen = self
            .placed
            .iter()
            .zip(&kept)
            .flat_map(|(placed, (moved, _))| {
                let (link, [weight, slope, _]) = (placed.link, placed.weight);
                let sign = link.image.sign;
                link.ends().map(move |(target, source)| Seen {
                    target,
                    source,
                    image: link.image,
                    weight: [sign * weight, sign * slope * moved.rate],
                })
            });
        (charges.collect(), seen.collect())
    }
}
