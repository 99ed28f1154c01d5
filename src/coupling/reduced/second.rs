//! Second derivatives along one displacement: the tangent of the first.

use super::linearised::ReducedLinearised;
use super::placed::{Charge, Moved, PlacedSkeletons};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::coupling::film::MovingFilms;
use crate::coupling::{Direction, Tangent};
use nalgebra::{DMatrix, DVector};

/// Work per pair of points, relative to that of the first derivative.
pub(super) const TANGENT: usize = 3;

impl ReducedLinearised<'_> {
    /// `DG[Z] α` at all points, a column for each of `alpha`; and of each link what the second derivative
    /// takes from there.
    pub(super) fn tangent_potentials(
        &self,
        alpha: &[&[f64]],
        z: &[Vec6],
        films: &MovingFilms,
    ) -> (DMatrix<f64>, Vec<(Moved, Vec<f64>)>) {
        let k = alpha.len();
        let one = |placed: &PlacedSkeletons| {
            let moved = placed.moved(&self.poses, z, films);
            let [at_target, at_source] = [placed.link.target, placed.link.source].map(|b| {
                let range = self.range(b);
                alpha.iter().map(|a| &a[range.clone()]).collect::<Vec<_>>()
            });
            let seen =
                placed.tangent_potentials(&self.reduced.bodies, &moved, &at_target, &at_source);
            ((seen.on_target, seen.on_source), (moved, seen.field))
        };
        let parts = self.reduced.over(&self.placed, TANGENT, one);
        let mut out = DMatrix::zeros(alpha.first().map_or(0, |a| a.len()), k);
        let mut add = |b: usize, values: &[f64]| {
            let from = self.range(b).start;
            for (i, row) in values.chunks_exact(k).enumerate() {
                for (c, x) in row.iter().enumerate() {
                    out[(from + i, c)] += x;
                }
            }
        };
        let mut kept = Vec::with_capacity(parts.len());
        for (placed, ((on_target, on_source), seen)) in self.placed.iter().zip(parts) {
            add(placed.link.target, &on_target);
            add(placed.link.source, &on_source);
            kept.push(seen);
        }
        (out, kept)
    }

    pub(super) fn second(&self, x: Direction, y: Direction, z: &[Vec6]) -> Tangent {
        let directions = Direction::distinct(x, y);
        let responses: Vec<_> = directions.into_iter().map(|x| self.respond(x)).collect();
        let n = responses.len();
        let alpha: Vec<&[f64]> = responses.iter().map(|r| r.alpha.as_slice()).collect();
        let films = self.films.along(z);
        let (psi, seen) = self.tangent_potentials(&alpha, z, &films);
        let (dalpha, dmomenta) = self.tangent_solution(&psi);
        let links: Vec<_> = self.placed.iter().zip(&seen).collect();
        let one = |(placed, seen): &(&PlacedSkeletons, &(Moved, Vec<f64>))| {
            self.link_tangent(placed, seen, &alpha, &dalpha)
        };
        let parts = self.reduced.over(&links, TANGENT, one);
        let momenta = (0..n).map(|k| dmomenta.column(k).into_owned()).collect();
        let twists: Vec<_> = responses.iter().map(|r| &r.twists).collect();
        self.gathered(z, &films, &parts, &twists, momenta)
    }

    /// All links and films along one displacement, for one or two directions' twists.
    pub(super) fn gathered(
        &self,
        z: &[Vec6],
        films: &MovingFilms,
        links: &[([Vec6; 2], [Vec3; 2])],
        twists: &[&DVector<f64>],
        mut momenta: Vec<DVector<f64>>,
    ) -> Tangent {
        let n = twists.len();
        let mut gradient = vec![Vec6::zeros(); self.reduced.bodies.len()];
        let mut wrench = gradient.clone();
        for (placed, ([w, dw], [f, df])) in self.placed.iter().zip(links) {
            placed.apply(&self.poses, &self.films, (w, f), &mut gradient);
            placed.apply_jvp(&self.poses, films, ([w, dw], [f, df]), z, &mut wrench);
        }
        films.add_tangent(twists, z, (&mut gradient, &mut wrench), &mut momenta);
        Tangent {
            momentum_x: momenta[0].clone(),
            momentum_y: momenta.swap_remove(n - 1),
            gradient,
            wrench,
        }
    }

    /// [`PlacedSkeletons::tangent`] of these charges at all points, a column each, that change so.
    pub(super) fn link_tangent(
        &self,
        placed: &PlacedSkeletons,
        (moved, field): &(Moved, Vec<f64>),
        alpha: &[&[f64]],
        dalpha: &DMatrix<f64>,
    ) -> ([Vec6; 2], [Vec3; 2]) {
        let rates = dalpha.as_slice().chunks_exact(dalpha.nrows().max(1));
        let [at_target, at_source] = [placed.link.target, placed.link.source].map(|b| {
            let range = self.range(b);
            let all = alpha.iter().zip(rates.clone());
            let own = all.map(|(value, rate)| Charge {
                value: &value[range.clone()],
                rate: &rate[range.clone()],
            });
            own.collect::<Vec<_>>()
        });
        let bodies = &self.reduced.bodies;
        placed.tangent(bodies, (moved, field), &at_target, &at_source)
    }
}
