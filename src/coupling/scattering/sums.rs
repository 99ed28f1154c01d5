//! The Coulomb sums of all bodies: what charges see of each other, and the forces on them.

use super::Scattering;
use super::far::{self, Moments};
use super::near::{Charged, Distances, NearPart, force_on};
use super::pairs::{Far, Near, Pairs, Weights};
use super::places::{Places, Triple, add, cross, dot, minus};
use crate::adjoint::lie::Vec6;
use crate::adjoint::multipole::{self, Arithmetic, Number, WIDTH};
use num_dual::Dual64;
use rayon::prelude::*;
use std::ops::Range;

/// Parts in which pairs are summed: the same whatever the number of threads, so that sums are.
const PARTS: usize = 4;
/// Pairs that aren't worth another thread.
const FEW: usize = 256;

/// Sums at some places.
pub(super) struct Sums<'s, T> {
    model: &'s Scattering,
    pairs: &'s Pairs,
    places: &'s Places<T>,
    weights: Weights<T>,
    /// Inverse distances of the first near pairs' points.
    known: Option<&'s Distances>,
}

/// The energy's gradient: in the charges the potentials that they see, and in the bodies' places spatial wrenches.
pub(super) struct Gradient<'s, T> {
    model: &'s Scattering,
    pub potentials: Vec<T>,
    /// On all that is seen.
    wrenches: Vec<[T; 6]>,
}

impl Gradient<'_, f64> {
    pub fn wrenches(&self) -> Vec<Vec6> {
        let all = self.wrenches.iter().map(|w| Vec6::from(*w));
        self.model.gathered_wrenches(all.collect())
    }
}

impl Gradient<'_, Dual64> {
    /// The wrenches, and their rates.
    pub fn wrenches_and_rates(&self) -> [Vec<Vec6>; 2] {
        let of = |part: fn(&Dual64) -> f64| {
            let all = self.wrenches.iter();
            let all = all.map(|w| Vec6::from_fn(|i, _| part(&w[i])));
            self.model.gathered_wrenches(all.collect())
        };
        [of(|x| x.re), of(|x| x.eps)]
    }
}

/// Parts of a list, each on a thread where they are worth it.
fn in_parts<I: Sync, P: Send>(items: &[I], part: impl Fn(&[I]) -> P + Sync + Send) -> Vec<P> {
    let size = items.len().div_ceil(PARTS).max(1);
    match items.len() < FEW {
        true => items.chunks(size).map(part).collect(),
        false => items.par_chunks(size).map(part).collect(),
    }
}

impl<'s, T: Number> Sums<'s, T> {
    pub fn new(model: &'s Scattering, pairs: &'s Pairs, places: &'s Places<T>) -> Self {
        Self {
            weights: pairs.weights(places, &model.levels),
            known: None,
            model,
            pairs,
            places,
        }
    }

    /// The same with inverse distances that are known.
    pub fn knowing(self, known: &'s Distances) -> Self {
        Self {
            known: Some(known),
            ..self
        }
    }

    /// Arms of a body's points from its centre, eight side by side, with the points.
    fn arms(&self, b: usize) -> impl Iterator<Item = (Range<usize>, [T::Pack; 3])> {
        let centre = self.places.centres[self.model.cells.leaf[b]];
        let all = self.model.points[b].clone();
        all.clone().step_by(WIDTH).map(move |first| {
            let range = first..(first + WIDTH).min(all.end);
            let arm = [0, 1, 2].map(|i| {
                let own = T::pack(&self.places.points[i][range.clone()]);
                own - T::pack(&[centre[i]; WIDTH])
            });
            (range, arm)
        })
    }

    /// The monomials of a cell's shift from its parent's centre.
    fn shift(&self, i: usize, out: &mut [T]) {
        let parent = self.model.cells.cells[i].parent;
        let way = minus(&self.places.centres[i], &self.places.centres[parent]);
        multipole::monomials(&self.model.table, &way, out);
    }

    /// `each` of every body with room for its part of `out`, `n` numbers a body.
    fn of_bodies<X: Send>(&self, out: &mut [X], n: usize, each: impl Fn(usize, &mut [X]) + Sync) {
        match self.model.points.len() < FEW {
            true => out.chunks_mut(n).enumerate().for_each(|(b, x)| each(b, x)),
            false => (out.par_chunks_mut(n).enumerate()).for_each(|(b, x)| each(b, x)),
        }
    }

    /// Moments of all cells about their centres.
    fn moments(&self, charges: &[T]) -> Vec<T> {
        let (table, cells) = (&self.model.table, &self.model.cells);
        let n = table.moments();
        let zero = T::constant(0.0);
        let mut of_bodies = vec![zero; n * self.model.points.len()];
        self.of_bodies(&mut of_bodies, n, |b, out| {
            multipole::vectorized(
                #[inline(always)]
                || {
                    let none = T::Pack::constant(0.0);
                    let (mut powers, mut sums) = (vec![none; n], vec![none; n]);
                    for (range, arm) in self.arms(b) {
                        let mut own = [zero; WIDTH];
                        own[..range.len()].copy_from_slice(&charges[range]);
                        multipole::monomials(table, &arm, &mut powers);
                        multipole::add_moments(&powers, T::pack(&own), &mut sums);
                    }
                    for (out, sum) in out.iter_mut().zip(&sums) {
                        *out = T::sum(sum);
                    }
                },
            );
        });
        let mut out = vec![zero; n * cells.cells.len()];
        for (own, leaf) in of_bodies.chunks_exact(n).zip(&cells.leaf) {
            out[n * leaf..][..n].copy_from_slice(own);
        }
        let (mut powers, mut room) = (vec![zero; n], vec![zero; table.derivatives()]);
        for i in (1..cells.cells.len()).rev() {
            self.shift(i, &mut powers);
            let (above, own) = out.split_at_mut(n * i);
            let above = &mut above[n * cells.cells[i].parent..][..n];
            multipole::shift(table, &powers, &own[..n], above, &mut room);
        }
        out
    }

    /// Coefficients of the potentials about all cells' centres, from all that they see; with what each far pair is worth if asked for.
    fn locals(&self, plain: &[T], slopes: bool) -> (Vec<T>, Vec<(T, Triple<T>)>) {
        let (table, cells) = (&self.model.table, &self.model.cells.cells);
        let n = table.moments();
        let mut signed = plain.to_vec();
        for (m, out) in plain.chunks_exact(n).zip(signed.chunks_exact_mut(n)) {
            multipole::signed(table, m, out);
        }
        let moments = Moments {
            table,
            places: self.places,
            weights: &self.weights,
            plain,
            signed: &signed,
        };
        let parts = in_parts(&self.pairs.far, |pairs: &[Far]| moments.part(pairs, slopes));
        let mut out = vec![T::constant(0.0); plain.len()];
        let mut worth = Vec::with_capacity(if slopes { self.pairs.far.len() } else { 0 });
        for part in parts {
            for (out, seen) in out.iter_mut().zip(&part.seen) {
                *out += *seen;
            }
            worth.extend(part.slopes);
        }
        let mut powers = vec![T::constant(0.0); n];
        let mut room = vec![T::constant(0.0); table.derivatives()];
        for (i, cell) in cells.iter().enumerate().skip(1) {
            self.shift(i, &mut powers);
            let (above, own) = out.split_at_mut(n * i);
            let bar = &above[n * cell.parent..][..n];
            multipole::shift_back(table, &powers, bar, &mut own[..n], &mut room);
        }
        (out, worth)
    }

    fn near(&self, charges: &[T], forces: bool) -> NearPart<T> {
        let charged = Charged {
            points: &self.model.points,
            places: self.places,
            weights: &self.weights,
            charges,
        };
        // Forces need the way as well.
        let known = self.known.filter(|_| !forces);
        let part = |pairs: &[Near]| charged.part(pairs, forces, known);
        let parts = in_parts(&self.pairs.near, part);
        let mut out = NearPart::zeros(charges.len(), forces);
        parts.into_iter().for_each(|part| out.add(part));
        out
    }

    /// What every point sees by the coefficients about its body's centre: the potential, and its gradient if it is asked for (zero else).
    fn seen_afar(&self, locals: &[T], slopes: bool) -> Vec<[T; 4]> {
        let (table, leaf) = (&self.model.table, &self.model.cells.leaf);
        let n = table.moments();
        let one = |b: usize| {
            multipole::vectorized(
                #[inline(always)]
                || {
                    let own = &locals[n * leaf[b]..][..n];
                    let local: Vec<T::Pack> = own.iter().map(|l| T::pack(&[*l; WIDTH])).collect();
                    let mut powers = vec![T::Pack::constant(0.0); n];
                    let mut out = Vec::with_capacity(self.model.points[b].len());
                    for (range, arm) in self.arms(b) {
                        multipole::monomials(table, &arm, &mut powers);
                        let seen = multipole::potential(&powers, &local);
                        let slope = match slopes {
                            true => multipole::potential_gradient(table, &powers, &local),
                            false => [T::Pack::constant(0.0); 3],
                        };
                        for k in 0..range.len() {
                            let [x, y, z] = [0, 1, 2].map(|i| T::lane(&slope[i], k));
                            out.push([T::lane(&seen, k), x, y, z]);
                        }
                    }
                    out
                },
            )
        };
        let bodies = 0..self.model.points.len();
        let all: Vec<Vec<[T; 4]>> = match bodies.len() < FEW {
            true => bodies.map(one).collect(),
            false => bodies.into_par_iter().map(one).collect(),
        };
        all.concat()
    }

    /// G α: the potential at each point that the other bodies' charges make.
    pub fn potentials(&self, charges: &[T]) -> Vec<T> {
        let charges = &*self.model.spread(charges);
        let (locals, _) = self.locals(&self.moments(charges), false);
        let mut out = self.near(charges, false).potentials;
        for (out, [seen, ..]) in out.iter_mut().zip(self.seen_afar(&locals, false)) {
            *out += seen;
        }
        self.model.gathered(out)
    }

    /// The gradient of ½ αᵀ G α.
    pub fn gradient(&self, charges: &[T]) -> Gradient<'s, T> {
        let charges = &*self.model.spread(charges);
        let (table, cells) = (&self.model.table, &self.model.cells);
        let n = table.moments();
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        let moments = self.moments(charges);
        let (locals, worth) = self.locals(&moments, true);
        let mut near = self.near(charges, true);
        let mut centres = vec![[zero; 3]; cells.cells.len()];
        let mut radii = vec![zero; cells.cells.len()];
        far::pull(&self.pairs.far, &worth, &self.weights, &mut centres);
        self.blends(&worth, &near.energies, &mut centres, &mut radii);
        let (mut powers, mut room) = (vec![zero; n], vec![zero; table.derivatives()]);
        for (i, cell) in cells.cells.iter().enumerate().skip(1) {
            self.shift(i, &mut powers);
            let (own, bar) = (&moments[n * i..][..n], &locals[n * cell.parent..][..n]);
            let slope = multipole::shift_gradient(table, &powers, own, bar, &mut room);
            add(&mut centres[i], one, &slope);
            add(&mut centres[cell.parent], -one, &slope);
        }
        let afar = self.seen_afar(&locals, true);
        for (b, leaf) in cells.leaf.iter().enumerate() {
            for j in self.model.points[b].clone() {
                let [_, x, y, z] = afar[j];
                add(&mut centres[*leaf], -charges[j], &[x, y, z]);
            }
        }
        let centres = self.places.pull_back(cells, &centres, &radii);
        let of = |b: usize| {
            let mut wrench = [zero; 6];
            let mut push = |x: &Triple<T>, force: &Triple<T>| {
                let turn = cross(x, force);
                for i in 0..3 {
                    wrench[i] += force[i];
                    wrench[3 + i] += turn[i];
                }
            };
            for j in self.model.points[b].clone() {
                let [_, x, y, z] = afar[j];
                let more = [x, y, z].map(|s| s * charges[j]);
                push(&self.places.point(j), &force_on(&near.forces, j, &more));
            }
            push(&self.places.centres[cells.leaf[b]], &centres[b]);
            wrench
        };
        let wrenches = (0..cells.leaf.len()).map(of).collect();
        for (out, [seen, ..]) in near.potentials.iter_mut().zip(&afar) {
            *out += *seen;
        }
        Gradient {
            model: self.model,
            wrenches,
            potentials: self.model.gathered(near.potentials),
        }
    }

    /// What moving the weights of the blends does: cotangents of the cells' centres and radii.
    fn blends(
        &self,
        far: &[(T, Triple<T>)],
        near: &[T],
        centres: &mut [Triple<T>],
        radii: &mut [T],
    ) {
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        let count = self.pairs.blends.len();
        // Of each blend: its moments' energy, and that of its halves, blends among them.
        let (mut own, mut halves) = (vec![zero; count], vec![zero; count]);
        for (pair, (energy, _)) in self.pairs.far.iter().zip(far) {
            match (pair.own, pair.within) {
                (Some(i), _) => own[i] = *energy,
                (None, Some(w)) => halves[w] += *energy,
                (None, None) => {}
            }
        }
        for (pair, energy) in self.pairs.near.iter().zip(near) {
            if let Some(w) = pair.within {
                halves[w] += *energy;
            }
        }
        for (i, blend) in self.pairs.blends.iter().enumerate().rev() {
            let [part, slope] = self.weights.own[i];
            if let Some(w) = blend.within {
                let whole = own[i] * part + halves[i] * (one - part);
                halves[w] += whole;
            }
            // ρ = (r_a + r_b)/R
            let bar = self.weights.around[i] * slope * (own[i] - halves[i]);
            let [a, b] = blend.cells;
            let way = minus(&self.places.centres[a], &self.places.centres[b]);
            let inverse = dot(&way, &way).root().inverse();
            radii[a] += bar * inverse;
            radii[b] += bar * inverse;
            let sum = self.places.radii[a] + self.places.radii[b];
            let along = -(bar * sum * inverse * inverse * inverse);
            add(&mut centres[a], along, &way);
            add(&mut centres[b], -along, &way);
        }
    }
}

/// Numbers as those that carry derivatives.
pub(super) fn dual(value: &[f64], rate: &[f64]) -> Vec<Dual64> {
    let each = value.iter().zip(rate);
    each.map(|(x, dx)| Dual64::new(*x, *dx)).collect()
}
