//! Near pairs of bodies, point by point.

use super::pairs::{Near, Weights};
use super::places::{Places, Triple, add};
use crate::adjoint::multipole::{self, Arithmetic, Number, WIDTH};
use std::ops::Range;

/// What some of the near pairs give.
pub(super) struct NearPart<T> {
    pub potentials: Vec<T>,
    pub forces: [Vec<T>; 3],
    /// Per pair.
    pub energies: Vec<T>,
}

impl<T: Number> NearPart<T> {
    pub fn zeros(points: usize, forces: bool) -> Self {
        let room = || vec![T::constant(0.0); if forces { points } else { 0 }];
        Self {
            potentials: vec![T::constant(0.0); points],
            forces: [room(), room(), room()],
            energies: Vec::new(),
        }
    }

    /// Adds another part.
    pub fn add(&mut self, other: Self) {
        let sum = |out: &mut [T], x: &[T]| {
            out.iter_mut().zip(x).for_each(|(out, x)| *out += *x);
        };
        sum(&mut self.potentials, &other.potentials);
        for (out, x) in self.forces.iter_mut().zip(&other.forces) {
            sum(out, x);
        }
        self.energies.extend(other.energies);
    }
}

/// The points and their charges.
pub(super) struct Charged<'m, T> {
    pub points: &'m [Range<usize>],
    pub places: &'m Places<T>,
    pub weights: &'m Weights<T>,
    pub charges: &'m [T],
}

impl<T: Number> Charged<'_, T> {
    /// What the points of some pairs see of each other, with the forces on them and energies if these are asked for.
    pub fn part(&self, pairs: &[Near], forces: bool) -> NearPart<T> {
        multipole::vectorized(
            #[inline(always)]
            || {
                let mut out = NearPart::zeros(self.charges.len(), forces);
                let mut other = Vec::new();
                for near in pairs {
                    self.load(near.bodies[1], &mut other);
                    let energy = self.pair(near, forces, &mut other, &mut out);
                    if forces {
                        out.energies.push(energy);
                    }
                }
                out
            },
        )
    }

    /// The points of a body, eight side by side.
    #[inline(always)]
    fn load(&self, b: usize, out: &mut Vec<Eight<T::Pack>>) {
        let (all, none) = (self.points[b].clone(), T::Pack::constant(0.0));
        out.clear();
        let mut first = all.start;
        while first < all.end {
            let last = (first + WIDTH).min(all.end);
            // Beyond the last point it stands again, without a charge.
            let mut charges = [T::constant(0.0); WIDTH];
            charges[..last - first].copy_from_slice(&self.charges[first..last]);
            out.push(Eight {
                first,
                count: last - first,
                at: [0, 1, 2].map(|i| T::pack(&self.places.points[i][first..last])),
                charges: T::pack(&charges),
                seen: none,
                force: [none; 3],
            });
            first = last;
        }
    }

    #[inline(always)]
    fn pair(
        &self,
        near: &Near,
        forces: bool,
        other: &mut [Eight<T::Pack>],
        out: &mut NearPart<T>,
    ) -> T {
        let weight = self.weights.within(near.within);
        let zero = T::Pack::constant(0.0);
        let mut energy = T::constant(0.0);
        for i in self.points[near.bodies[0]].clone() {
            let own = T::pack(&[self.charges[i]; WIDTH]);
            let point = self.places.point(i).map(|x| T::pack(&[x; WIDTH]));
            let (mut seen, mut force) = (zero, [zero; 3]);
            for eight in other.iter_mut() {
                let way = [0, 1, 2].map(|k| point[k] - eight.at[k]);
                let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
                let inverse = square.inverse_root();
                let product = own * inverse;
                eight.seen += product;
                seen += eight.charges * inverse;
                if forces {
                    // The gradient of 1/r in the first's point.
                    let slope = -(product * eight.charges * (inverse * inverse));
                    for k in 0..3 {
                        let along = slope * way[k];
                        eight.force[k] += along;
                        force[k] += along;
                    }
                }
            }
            let seen = T::sum(&seen);
            out.potentials[i] += seen * weight;
            if forces {
                energy += seen * self.charges[i];
                for (out, force) in out.forces.iter_mut().zip(&force) {
                    out[i] += T::sum(force) * weight;
                }
            }
        }
        for eight in other.iter() {
            for k in 0..eight.count {
                let j = eight.first + k;
                out.potentials[j] += T::lane(&eight.seen, k) * weight;
                if forces {
                    for (out, force) in out.forces.iter_mut().zip(&eight.force) {
                        out[j] += -(T::lane(force, k) * weight);
                    }
                }
            }
        }
        energy
    }
}

/// Points of the second body of a pair, side by side: how many from which on, their charges, what they see, and what the first's forces are against theirs.
struct Eight<P> {
    first: usize,
    count: usize,
    at: [P; 3],
    charges: P,
    seen: P,
    force: [P; 3],
}

/// Adds forces, coordinate by coordinate, to a vector.
pub(super) fn force_on<T: Number>(forces: &[Vec<T>; 3], j: usize, more: &Triple<T>) -> Triple<T> {
    let mut out = [0, 1, 2].map(|i| forces[i][j]);
    add(&mut out, T::constant(1.0), more);
    out
}
