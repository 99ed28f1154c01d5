//! The Coulomb sums of all bodies: what charges see of each other, and the forces on them.

use super::Scattering;
use super::far::{self, Derivatives, Moments};
use super::near::{Charged, NearPart, force_on};
use super::pairs::{Far, Near, Pairs, Weights};
use super::parts::{FEW, in_parts, of_each};
use super::places::{Places, Triple, add, cross, dot, minus};
use crate::adjoint::lie::Vec6;
use crate::adjoint::multipole::{self, Arithmetic, Number, WIDTH};
use num_dual::Dual64;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Sums at some places.
pub(super) struct Sums<'s, T> {
    pub model: &'s Scattering,
    pub pairs: &'s Pairs,
    pub places: &'s Places<T>,
    pub weights: Arc<Weights<T>>,
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

impl<'s, T: Number> Sums<'s, T> {
    pub fn new(model: &'s Scattering, pairs: &'s Pairs, places: &'s Places<T>) -> Self {
        let weights = Arc::new(pairs.weights(places, &model.levels));
        Self::with_weights(model, pairs, places, weights)
    }

    /// With the weights of these pairs there.
    pub fn with_weights(
        model: &'s Scattering,
        pairs: &'s Pairs,
        places: &'s Places<T>,
        weights: Arc<Weights<T>>,
    ) -> Self {
        Self {
            weights,
            model,
            pairs,
            places,
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

    /// `each` of every body with room for its part, `n` numbers a body.
    pub fn of_bodies(&self, n: usize, each: impl Fn(usize, &mut [T]) + Sync) -> Vec<T> {
        let count = self.model.points.len();
        let mut out = vec![T::constant(0.0); n * count];
        match count < FEW {
            true => (out.chunks_mut(n).enumerate()).for_each(|(b, x)| each(b, x)),
            false => (out.par_chunks_mut(n).enumerate()).for_each(|(b, x)| each(b, x)),
        }
        out
    }

    /// Moments of unit charges at a body's points about its centre, point by point, but for what they are together.
    pub fn moments_of_points(&self, b: usize) -> Vec<T> {
        let table = &self.model.table;
        let n = table.moments();
        let mut out = vec![T::constant(0.0); n * self.model.points[b].len()];
        multipole::vectorized(
            #[inline(always)]
            || {
                let mut powers = vec![T::Pack::constant(0.0); n];
                for ((_, arm), out) in self.arms(b).zip(out.chunks_mut(n * WIDTH)) {
                    multipole::monomials(table, &arm, &mut powers);
                    for (k, out) in out.chunks_exact_mut(n).enumerate() {
                        for (out, power) in out.iter_mut().zip(&powers).skip(1) {
                            *out = T::lane(power, k);
                        }
                    }
                }
            },
        );
        out
    }

    /// Moments of all cells about their centres.
    fn moments(&self, charges: &[T]) -> Vec<T> {
        let table = &self.model.table;
        let n = table.moments();
        let zero = T::constant(0.0);
        let of_bodies = self.of_bodies(n, |b, out| {
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
        self.upward(&of_bodies)
    }

    /// Moments of all cells from those of the bodies.
    pub fn upward(&self, of_bodies: &[T]) -> Vec<T> {
        let (table, cells) = (&self.model.table, &self.model.cells);
        let n = table.moments();
        let zero = T::constant(0.0);
        let mut out = vec![zero; n * cells.cells.len()];
        for (own, leaf) in of_bodies.chunks_exact(n).zip(&cells.leaf) {
            out[n * leaf..][..n].copy_from_slice(own);
        }
        if !cells.cells.is_empty() {
            self.up_within(0, &mut out);
        }
        out
    }

    /// Adds up the moments within a cell, which stand in `out` with its own first.
    fn up_within(&self, cell: usize, out: &mut [T]) {
        let (table, cells) = (&self.model.table, &self.model.cells);
        let n = table.moments();
        let zero = T::constant(0.0);
        let (mut powers, mut room) = (vec![zero; n], vec![zero; table.derivatives()]);
        let mut add = |i: usize, above: &mut [T], own: &[T]| {
            self.shift(i, &mut powers);
            multipole::shift(table, &powers, &own[..n], &mut above[..n], &mut room);
        };
        let Some([left, right]) = cells.split(cell) else {
            for i in cells.within(cell).skip(1).rev() {
                let (above, own) = out.split_at_mut(n * (i - cell));
                add(i, &mut above[n * (cells.cells[i].parent - cell)..], own);
            }
            return;
        };
        let (own, rest) = out.split_at_mut(n);
        let (of_left, of_right) = rest.split_at_mut(n * (right - left));
        rayon::join(
            || self.up_within(left, of_left),
            || self.up_within(right, of_right),
        );
        add(right, own, of_right);
        add(left, own, of_left);
    }

    /// The transpose of [`Sums::up_within`]: hands what a cell sees on to all within it.
    fn down_within(&self, cell: usize, out: &mut [T]) {
        let (table, cells) = (&self.model.table, &self.model.cells);
        let n = table.moments();
        let zero = T::constant(0.0);
        let (mut powers, mut room) = (vec![zero; n], vec![zero; table.derivatives()]);
        let mut add = |i: usize, above: &[T], own: &mut [T]| {
            self.shift(i, &mut powers);
            multipole::shift_back(table, &powers, &above[..n], &mut own[..n], &mut room);
        };
        let Some([left, right]) = cells.split(cell) else {
            for i in cells.within(cell).skip(1) {
                let (above, own) = out.split_at_mut(n * (i - cell));
                add(i, &above[n * (cells.cells[i].parent - cell)..], own);
            }
            return;
        };
        let (own, rest) = out.split_at_mut(n);
        let (of_left, of_right) = rest.split_at_mut(n * (right - left));
        add(left, own, of_left);
        add(right, own, of_right);
        rayon::join(
            || self.down_within(left, of_left),
            || self.down_within(right, of_right),
        );
    }

    /// Coefficients of the potentials about all cells' centres, from all that they see; with what each far pair is worth if asked for.
    pub fn locals(
        &self,
        plain: &[T],
        slopes: bool,
        known: Option<&Derivatives<T>>,
    ) -> (Vec<T>, Vec<(T, Triple<T>)>) {
        let table = &self.model.table;
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
        let parts = in_parts(&self.pairs.far, |number, pairs: &[Far]| {
            moments.part(pairs, slopes, known.map(|known| known.part(number)))
        });
        let mut out = vec![T::constant(0.0); plain.len()];
        let mut worth = Vec::with_capacity(if slopes { self.pairs.far.len() } else { 0 });
        for part in parts {
            for (out, seen) in out.iter_mut().zip(&part.seen) {
                *out += *seen;
            }
            worth.extend(part.slopes);
        }
        if !out.is_empty() {
            self.down_within(0, &mut out);
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
        let part = |_, pairs: &[Near]| charged.part(pairs, forces);
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
        of_each(self.model.points.len(), one).concat()
    }

    /// G α: the potential at each point that the other bodies' charges make.
    pub fn potentials(&self, charges: &[T]) -> Vec<T> {
        let charges = &*self.model.spread(charges);
        let (locals, _) = self.locals(&self.moments(charges), false, None);
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
        let (locals, worth) = self.locals(&moments, true, None);
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
