//! The Coulomb sums of all bodies: what charges see of each other, and the forces on them.

use super::Scattering;
use super::pairs::{Far, Near, Pairs, Weights};
use super::places::{Places, Triple, add, cross, dot, minus};
use crate::adjoint::lie::Vec6;
use crate::adjoint::multipole::{self, Number};
use rayon::prelude::*;

/// Parts in which pairs are summed: the same whatever the number of threads, so that sums are.
const PARTS: usize = 8;

/// Sums at some places.
pub(super) struct Sums<'s, T> {
    pub model: &'s Scattering,
    pub pairs: &'s Pairs,
    pub places: &'s Places<T>,
    pub weights: Weights<T>,
}

/// The energy's gradient: in the charges the potentials that they see, and in the bodies' places spatial wrenches.
pub(super) struct Gradient<T> {
    pub potentials: Vec<T>,
    pub wrenches: Vec<[T; 6]>,
}

impl Gradient<f64> {
    pub fn wrenches(&self) -> Vec<Vec6> {
        self.wrenches.iter().map(|w| Vec6::from(*w)).collect()
    }
}

impl Gradient<num_dual::Dual64> {
    /// The wrenches, and their rates.
    pub fn wrenches_and_rates(&self) -> [Vec<Vec6>; 2] {
        let of = |part: fn(&num_dual::Dual64) -> f64| {
            let each = self.wrenches.iter();
            each.map(|w| Vec6::from_fn(|i, _| part(&w[i]))).collect()
        };
        [of(|x| x.re), of(|x| x.eps)]
    }
}

/// What a part of the far pairs gives.
struct FarPart<T> {
    seen: Vec<T>,
    /// Per pair: the energy, and its slope in the way from the second centre to the first.
    slopes: Vec<(T, Triple<T>)>,
}

/// What a part of the near pairs gives.
struct NearPart<T> {
    potentials: Vec<T>,
    forces: Vec<Triple<T>>,
    energies: Vec<T>,
}

impl<'s, T: Number> Sums<'s, T> {
    pub fn new(model: &'s Scattering, pairs: &'s Pairs, places: &'s Places<T>) -> Self {
        Self {
            weights: pairs.weights(places, &model.levels.apart),
            model,
            pairs,
            places,
        }
    }

    fn moments_of_one(&self) -> usize {
        self.model.table.moments()
    }

    /// Arms of a body's points from its centre.
    fn arms(&self, b: usize) -> impl Iterator<Item = (usize, Triple<T>)> {
        let centre = &self.places.centres[self.model.cells.leaf[b]];
        let range = self.model.points[b].clone();
        range.map(move |j| (j, minus(&self.places.points[j], centre)))
    }

    /// The monomials of a cell's shift from its parent's centre.
    fn shift(&self, i: usize, out: &mut [T]) {
        let parent = self.model.cells.cells[i].parent;
        let way = minus(&self.places.centres[i], &self.places.centres[parent]);
        multipole::monomials(&self.model.table, &way, out);
    }

    /// Moments of all cells about their centres.
    fn moments(&self, charges: &[T]) -> Vec<T> {
        let (n, table) = (self.moments_of_one(), &self.model.table);
        let cells = &self.model.cells;
        let zero = T::from(0.0);
        let mut out = vec![zero; n * cells.cells.len()];
        let mut powers = vec![zero; n];
        for (b, leaf) in cells.leaf.iter().enumerate() {
            let own = &mut out[n * leaf..n * (leaf + 1)];
            for (j, arm) in self.arms(b) {
                multipole::monomials(table, &arm, &mut powers);
                multipole::add_moments(&powers, charges[j], own);
            }
        }
        for i in (1..cells.cells.len()).rev() {
            self.shift(i, &mut powers);
            let (above, own) = out.split_at_mut(n * i);
            let parent = n * cells.cells[i].parent;
            multipole::shift(table, &powers, &own[..n], &mut above[parent..parent + n]);
        }
        out
    }

    fn far_part(&self, pairs: &[Far], moments: [&[T]; 2], slopes: bool) -> FarPart<T> {
        let (n, table) = (self.moments_of_one(), &self.model.table);
        let zero = T::from(0.0);
        let mut out = FarPart {
            seen: vec![zero; moments[0].len()],
            slopes: Vec::with_capacity(if slopes { pairs.len() } else { 0 }),
        };
        let mut d = vec![zero; table.derivatives(slopes)];
        let (mut seen_a, mut seen_b) = (vec![zero; n], vec![zero; n]);
        for far in pairs {
            let [a, b] = far.cells;
            let way = minus(&self.places.centres[a], &self.places.centres[b]);
            multipole::derivatives(table, &way, slopes, &mut d);
            let both = [&moments[0][n * a..][..n], &moments[1][n * b..][..n]];
            let weight = self.weights.of(far);
            seen_a.fill(zero);
            seen_b.fill(zero);
            multipole::see(table, &d, weight, both, [&mut seen_a, &mut seen_b]);
            for (out, seen) in out.seen[n * a..][..n].iter_mut().zip(&seen_a) {
                *out += *seen;
            }
            let signed = out.seen[n * b..][..n].iter_mut();
            for ((out, seen), sign) in signed.zip(&seen_b).zip(table.signs()) {
                *out += *seen * *sign;
            }
            if slopes {
                out.slopes.push(multipole::energy(table, &d, both));
            }
        }
        out
    }

    /// Coefficients of the potentials about all cells' centres, from all that they see; with what each far pair is worth if asked for.
    fn locals(&self, moments: &[T], slopes: bool) -> (Vec<T>, Vec<(T, Triple<T>)>) {
        let (n, table) = (self.moments_of_one(), &self.model.table);
        let cells = &self.model.cells.cells;
        let mut signed = moments.to_vec();
        for (m, out) in moments.chunks_exact(n).zip(signed.chunks_exact_mut(n)) {
            multipole::signed(table, m, out);
        }
        let size = self.pairs.far.len().div_ceil(PARTS).max(1);
        let one = |pairs: &[Far]| self.far_part(pairs, [moments, &signed], slopes);
        let parts: Vec<FarPart<T>> = self.pairs.far.par_chunks(size).map(one).collect();
        let mut out = vec![T::from(0.0); moments.len()];
        let mut worth = Vec::with_capacity(if slopes { self.pairs.far.len() } else { 0 });
        for part in parts {
            for (out, seen) in out.iter_mut().zip(&part.seen) {
                *out += *seen;
            }
            worth.extend(part.slopes);
        }
        let mut powers = vec![T::from(0.0); n];
        for (i, cell) in cells.iter().enumerate().skip(1) {
            self.shift(i, &mut powers);
            let (above, own) = out.split_at_mut(n * i);
            let bar = &above[n * cell.parent..][..n];
            multipole::shift_back(table, &powers, bar, &mut own[..n]);
        }
        (out, worth)
    }

    fn near_part(&self, pairs: &[Near], charges: &[T], forces: bool) -> NearPart<T> {
        let zero = T::from(0.0);
        let n = charges.len();
        let mut out = NearPart {
            potentials: vec![zero; n],
            forces: vec![[zero; 3]; if forces { n } else { 0 }],
            energies: Vec::with_capacity(if forces { pairs.len() } else { 0 }),
        };
        for near in pairs {
            let [a, b] = near.bodies.map(|b| self.model.points[b].clone());
            let weight = self.weights.within(near.within);
            let mut energy = zero;
            for i in a {
                let (x, charge) = (&self.places.points[i], charges[i]);
                let (mut seen, mut force) = (zero, [zero; 3]);
                for j in b.clone() {
                    let way = minus(x, &self.places.points[j]);
                    let inverse = dot(&way, &way).recip().sqrt();
                    seen += charges[j] * inverse;
                    out.potentials[j] += charge * inverse * weight;
                    if forces {
                        // The gradient of 1/r in x.
                        let slope = -(charge * charges[j] * inverse * inverse * inverse);
                        add(&mut force, slope, &way);
                        add(&mut out.forces[j], -slope * weight, &way);
                    }
                }
                out.potentials[i] += seen * weight;
                if forces {
                    add(&mut out.forces[i], weight, &force);
                    energy += charge * seen;
                }
            }
            if forces {
                out.energies.push(energy);
            }
        }
        out
    }

    fn near(&self, charges: &[T], forces: bool) -> NearPart<T> {
        let zero = T::from(0.0);
        let size = self.pairs.near.len().div_ceil(PARTS).max(1);
        let one = |pairs: &[Near]| self.near_part(pairs, charges, forces);
        let parts: Vec<NearPart<T>> = self.pairs.near.par_chunks(size).map(one).collect();
        let mut out = NearPart {
            potentials: vec![zero; charges.len()],
            forces: vec![[zero; 3]; if forces { charges.len() } else { 0 }],
            energies: Vec::new(),
        };
        for part in parts {
            for (out, x) in out.potentials.iter_mut().zip(&part.potentials) {
                *out += *x;
            }
            for (out, x) in out.forces.iter_mut().zip(&part.forces) {
                add(out, T::from(1.0), x);
            }
            out.energies.extend(part.energies);
        }
        out
    }

    /// G α: the potential at each point that the other bodies' charges make.
    pub fn potentials(&self, charges: &[T]) -> Vec<T> {
        let (n, table) = (self.moments_of_one(), &self.model.table);
        let (locals, _) = self.locals(&self.moments(charges), false);
        let mut out = self.near(charges, false).potentials;
        let mut powers = vec![T::from(0.0); n];
        for (b, leaf) in self.model.cells.leaf.iter().enumerate() {
            let local = &locals[n * leaf..][..n];
            for (j, arm) in self.arms(b) {
                multipole::monomials(table, &arm, &mut powers);
                out[j] += multipole::potential(&powers, local);
            }
        }
        out
    }

    /// The gradient of ½ αᵀ G α.
    pub fn gradient(&self, charges: &[T]) -> Gradient<T> {
        let (n, table, cells) = (
            self.moments_of_one(),
            &self.model.table,
            &self.model.cells,
        );
        let (zero, one) = (T::from(0.0), T::from(1.0));
        let moments = self.moments(charges);
        let (locals, far) = self.locals(&moments, true);
        let NearPart {
            mut potentials,
            mut forces,
            energies,
        } = self.near(charges, true);
        let mut centres = vec![[zero; 3]; cells.cells.len()];
        let mut radii = vec![zero; cells.cells.len()];
        for (pair, (_, slope)) in self.pairs.far.iter().zip(&far) {
            let weight = self.weights.of(pair);
            let [a, b] = pair.cells;
            add(&mut centres[a], weight, slope);
            add(&mut centres[b], -weight, slope);
        }
        self.blends(&far, &energies, &mut centres, &mut radii);
        let mut powers = vec![zero; n];
        for (i, cell) in cells.cells.iter().enumerate().skip(1) {
            self.shift(i, &mut powers);
            let (own, bar) = (&moments[n * i..][..n], &locals[n * cell.parent..][..n]);
            let slope = multipole::shift_gradient(table, &powers, own, bar);
            add(&mut centres[i], one, &slope);
            add(&mut centres[cell.parent], -one, &slope);
        }
        for (b, leaf) in cells.leaf.iter().enumerate() {
            let local = &locals[n * leaf..][..n];
            for (j, arm) in self.arms(b) {
                multipole::monomials(table, &arm, &mut powers);
                potentials[j] += multipole::potential(&powers, local);
                let slope = multipole::potential_gradient(table, &powers, local);
                add(&mut forces[j], charges[j], &slope);
                add(&mut centres[*leaf], -charges[j], &slope);
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
                push(&self.places.points[j], &forces[j]);
            }
            push(&self.places.centres[cells.leaf[b]], &centres[b]);
            wrench
        };
        Gradient {
            wrenches: (0..cells.leaf.len()).map(of).collect(),
            potentials,
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
        let zero = T::from(0.0);
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
                let whole = own[i] * part + halves[i] * (T::from(1.0) - part);
                halves[w] += whole;
            }
            // ρ = (r_a + r_b)/R
            let bar = self.weights.around[i] * slope * (own[i] - halves[i]);
            let [a, b] = blend.cells;
            let way = minus(&self.places.centres[a], &self.places.centres[b]);
            let square = dot(&way, &way);
            let inverse = square.recip().sqrt();
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
pub(super) fn dual(value: &[f64], rate: &[f64]) -> Vec<num_dual::Dual64> {
    let each = value.iter().zip(rate);
    each.map(|(x, dx)| num_dual::Dual64::new(*x, *dx)).collect()
}
