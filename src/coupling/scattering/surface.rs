//! The flow on the bodies' surfaces, and its transpose: of the charges that the exchange comes to, each surface sees those of all others point by point, without levels.

use super::Scattering;
use super::linearised::Dense;
use super::scattered::{Moving, Scattered, balance, mixed, plus};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::boundary::PanelBoundary;
use crate::coupling::pair::Pair;
use crate::coupling::reduced::FLUX;
use crate::coupling::surface::{self, Charges, Held, Seen};
use crate::coupling::surface_back::{Back, onto_charges, pull_pair};
use crate::coupling::{Motion, MotionBar, SurfacePotential};
use crate::solver::Columns;
use nalgebra::DMatrix;
use std::sync::Arc;

impl Scattering {
    /// The bodies of a motion, without a basis.
    fn still(&self, motion: &Motion) -> Result<Scattered<'_>> {
        let none = DMatrix::zeros(6 * self.bodies.len(), 0);
        self.place(motion.poses, Box::new(Dense(none)))
    }

    /// Whose sources a body sees: those of all others, and all images, its own among them.
    fn seen_by(&self, target: usize) -> Vec<Seen> {
        let seen = (0..self.bodies.len()).flat_map(|source| {
            let images = self.images.iter().filter(move |image| {
                !image.is_identity() || (target != source && !self.refuses(target, source))
            });
            images.map(move |image| Seen {
                target,
                source,
                image: *image,
                weight: [image.sign, 0.0],
            })
        });
        seen.collect()
    }

    /// Whether two bodies don't feel each other.
    fn refuses(&self, a: usize, b: usize) -> bool {
        let [a, b] = [a, b].map(|b| self.cells.leaf[b]);
        self.refused.contains(&[a.min(b), a.max(b)])
    }

    /// [`Coupling::surface_potentials`](crate::coupling::Coupling::surface_potentials).
    pub(super) fn potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        surface::check(motion, surfaces)?;
        let at = self.still(motion)?;
        let moving = at.moving(motion.displacement);
        let strengths = at.strengths(motion, &moving);
        let charges = self.bodies.iter().zip(&self.points);
        let charges: Vec<Charges> = charges
            .map(|(body, range)| Charges {
                points: &body.parts().points,
                strengths: strengths.part(range),
            })
            .collect();
        at.check()?;
        let held = at.narrow.any().then(|| Held {
            films: at.narrow.films(),
            moving: moving.narrow.films(),
        });
        Ok(surface::on_surfaces(
            motion,
            surfaces,
            &charges,
            |b| self.seen_by(b),
            held,
        ))
    }

    /// [`Coupling::surface_potentials_vjp`](crate::coupling::Coupling::surface_potentials_vjp), of bodies that no film holds apart: as the factor's, with its solves by products.
    pub(super) fn potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        surface::check(motion, surfaces)?;
        let (at, z) = (self.still(motion)?, motion.displacement);
        if at.narrow.any() {
            return Err(surface::held_apart());
        }
        let Back { mut bar, densities } = onto_charges(surfaces, bars)?;
        let moving = at.moving(z);
        let strengths = at.strengths(motion, &moving);
        let still = vec![Vec6::zeros(); self.bodies.len()];
        let mut pulls = [still.clone(), still];
        let mut beta = Columns::zeros(strengths.rows, 2);
        let place = |b: usize| (b, &motion.poses[b]);
        for seen in (0..self.bodies.len()).flat_map(|b| self.seen_by(b)) {
            let (t, s) = (seen.target, seen.source);
            let points = &self.bodies[s].parts().points;
            let pair = Pair::new(place(t), place(s), &seen.image, points);
            let seen_by = (&surfaces[t].faces.centres[..], &densities[t]);
            let sources = (&self.points[s], &strengths);
            pull_pair(motion, &pair, seen_by, sources, &mut beta, &mut pulls);
        }
        let [mut gradient, mut wrench] = pulls;
        let [values, rates] = [0, 1].map(|k| beta.column(k));
        let (of_rates, impulses) = at.answered(&rates);
        bar.rates += impulses / FLUX;
        let turned = at.tangent_potentials(&moving, &of_rates);
        let (of_values, impulses) = at.answered(&plus(&values, 1.0, &turned));
        bar.twists += impulses / FLUX;
        // Charges, and what answers the cotangents of their rates, with the rates of both.
        let [alpha, change] = [0, 1].map(|k| strengths.column(k));
        let part = balance(&alpha, &of_rates);
        let [sum, difference] = [part, -part].map(|part| {
            let charges = plus(&alpha, part, &of_rates);
            at.gradient_jvp(&moving, &charges, &plus(&change, part, &of_values))
        });
        at.check()?;
        for (out, sum, difference) in [
            (&mut gradient, &sum.gradient, &difference.gradient),
            (&mut wrench, &sum.rate, &difference.rate),
        ] {
            let both = mixed(sum, difference, part);
            out.iter_mut().zip(both).for_each(|(w, x)| *w += x / FLUX);
        }
        bar.add_pull(z, &gradient, &wrench);
        Ok(bar)
    }
}

impl Scattered<'_> {
    /// All charges of a motion, and their rates as twists gain theirs and bodies are displaced: two columns, the second zero where no rates are asked for.
    fn strengths(&self, motion: &Motion, moving: &Moving) -> Columns {
        let charges = &self.respond(motion.twists).charges;
        let rates = match motion.rates {
            None => vec![0.0; charges.len()],
            Some(rates) => {
                let seen = self.tangent_potentials(moving, charges);
                self.answering_beside(rates, &seen)
            }
        };
        Columns::from_columns(&[charges, &rates])
    }
}
