//! What each body sees of the others: their charges, and the rates of these as all move.

use super::linearised::ReducedLinearised;
use crate::coupling::film::MovingFilms;
use crate::coupling::surface::{Charges, Motion, Seen};
use crate::solver::Columns;

impl ReducedLinearised<'_> {
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
        let charges = self.reduced.bodies.iter().enumerate().map(|(b, body)| {
            let from = self.range(b).start;
            let strength = |j: usize, k: usize| match k {
                0 => self.alpha[(from + j, 0)],
                _ => self.alpha[(from + j, 1)] + displaced[(from + j, 0)],
            };
            Charges {
                points: &body.parts().points,
                strengths: Columns::from_fn(body.points(), 2, strength),
            }
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
