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
    pub fn part(&self, pairs: &[Near], forces: bool, known: Option<&Distances>) -> NearPart<T> {
        multipole::vectorized(
            #[inline(always)]
            || {
                let mut out = NearPart::zeros(self.charges.len(), forces);
                let (mut other, mut row) = (Vec::new(), Row::new());
                for near in pairs {
                    if let Some(inverse) = known.and_then(|known| known.of(near.number)) {
                        self.known_pair(near, inverse, &mut out.potentials);
                        continue;
                    }
                    if !forces && self.plain_pair(near, &mut row, &mut out.potentials) {
                        continue;
                    }
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
    fn known_pair(&self, near: &Near, inverse: &[f64], out: &mut [T]) {
        let [a, b] = near.bodies.map(|b| self.points[b].clone());
        let weight = self.weights.within(near.within);
        let others = &self.charges[b.clone()];
        let mut seen_b = vec![T::constant(0.0); b.len()];
        for (i, row) in a.zip(inverse.chunks_exact(b.len())) {
            let own = self.charges[i];
            for (seen, inverse) in seen_b.iter_mut().zip(row) {
                *seen += own * *inverse;
            }
            out[i] += sum_of_products(others, row) * weight;
        }
        for (out, seen) in out[b].iter_mut().zip(seen_b) {
            *out += seen * weight;
        }
    }

    /// A pair of which only potentials are asked for, row by row, if these numbers have loops for it.
    #[inline(always)]
    fn plain_pair(&self, near: &Near, row: &mut Row<T>, out: &mut [T]) -> bool {
        let [a, b] = near.bodies.map(|b| self.points[b].clone());
        let weight = self.weights.within(near.within);
        let (count, zero) = (b.len().next_multiple_of(WIDTH), T::constant(0.0));
        // Beyond the last point it stands again, without a charge.
        for (own, all) in row.at.iter_mut().zip(&self.places.points) {
            own.clear();
            own.extend_from_slice(&all[b.clone()]);
            own.resize(count, all[b.end - 1]);
        }
        row.charges.clear();
        row.charges.extend_from_slice(&self.charges[b.clone()]);
        row.charges.resize(count, zero);
        row.seen.clear();
        row.seen.resize(count, zero);
        row.inverse.resize(count, zero);
        for i in a {
            let to = [0, 1, 2].map(|k| &row.at[k][..count]);
            let inverse = &mut row.inverse[..count];
            if !T::inverse_distances(&self.places.point(i), to, inverse) {
                return false;
            }
            let own = self.charges[i];
            let mut lanes = [zero; WIDTH];
            let each = inverse.chunks_exact(WIDTH);
            let seen = row.seen.chunks_exact_mut(WIDTH);
            for ((inverse, seen), others) in each.zip(seen).zip(row.charges.chunks_exact(WIDTH)) {
                for k in 0..WIDTH {
                    seen[k] += own * inverse[k];
                    lanes[k] += others[k] * inverse[k];
                }
            }
            out[i] += T::sum(&T::pack(&lanes)) * weight;
        }
        for (out, seen) in out[b].iter_mut().zip(&row.seen) {
            *out += *seen * weight;
        }
        true
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

/// The second body of a pair, filled up to eights: its points, charges, what they see, and inverse distances from one of the first's.
struct Row<T> {
    at: [Vec<T>; 3],
    charges: Vec<T>,
    seen: Vec<T>,
    inverse: Vec<T>,
}

impl<T> Row<T> {
    fn new() -> Self {
        let none = Vec::new;
        Self {
            at: [none(), none(), none()],
            charges: none(),
            seen: none(),
            inverse: none(),
        }
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

/// Σ xᵢ yᵢ in lanes that are added up at the end, so that it is as fast as the processor's vectors are wide.
#[inline(always)]
fn sum_of_products<T: Number>(x: &[T], y: &[f64]) -> T {
    let mut lanes = [T::constant(0.0); WIDTH];
    let (mut eights, mut rows) = (x.chunks_exact(WIDTH), y.chunks_exact(WIDTH));
    for (x, y) in (&mut eights).zip(&mut rows) {
        for ((lane, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *lane += *x * *y;
        }
    }
    let rest = eights.remainder().iter().zip(rows.remainder());
    for (lane, (x, y)) in lanes.iter_mut().zip(rest) {
        *lane += *x * *y;
    }
    T::sum(&T::pack(&lanes))
}

/// Inverse distances between the points of near pairs, which a solve asks for again and again: of the first pairs, as far as there is room.
#[derive(Default)]
pub(super) struct Distances {
    /// Where those of each pair end.
    ends: Vec<usize>,
    all: Vec<f64>,
}

/// Numbers kept for each point, and in all: 32 MB.
const KEPT: usize = 96;
const MOST: usize = 1 << 22;

impl Distances {
    pub fn new(pairs: &[Near], points: &[Range<usize>], places: &Places<f64>) -> Self {
        let room = MOST.min(KEPT * places.points[0].len());
        let mut out = Self {
            ends: Vec::new(),
            all: Vec::with_capacity(room),
        };
        for near in pairs {
            let [a, b] = near.bodies.map(|b| points[b].clone());
            if out.all.len() + a.len() * b.len() > room {
                break;
            }
            for i in a {
                let x = places.point(i);
                out.all.extend(b.clone().map(|j| {
                    let y = places.point(j);
                    let way = [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
                    1.0 / (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt()
                }));
            }
            out.ends.push(out.all.len());
        }
        out
    }

    /// Those of a pair by its number, row by row of the first body's points.
    fn of(&self, number: usize) -> Option<&[f64]> {
        let end = *self.ends.get(number)?;
        let start = match number {
            0 => 0,
            n => self.ends[n - 1],
        };
        Some(&self.all[start..end])
    }
}

/// Adds forces, coordinate by coordinate, to a vector.
pub(super) fn force_on<T: Number>(forces: &[Vec<T>; 3], j: usize, more: &Triple<T>) -> Triple<T> {
    let mut out = [0, 1, 2].map(|i| forces[i][j]);
    add(&mut out, T::constant(1.0), more);
    out
}
