//! Far pairs of cells, eight side by side.

use super::pairs::{Far, Weights};
use super::parts::in_parts;
use super::places::{Places, Triple, add, minus};
use super::spare::Spare;
use crate::adjoint::multipole::{self, Arithmetic, Number, Table, WIDTH};

/// What some of the far pairs give.
pub(super) struct FarPart<T> {
    /// Coefficients of the potentials about the cells' centres, by the cells.
    pub seen: Vec<T>,
    /// Per pair: the energy, and its slope in the way from the second centre to the first.
    pub slopes: Vec<(T, Triple<T>)>,
}

/// The cells and their moments, plain and with signs.
pub(super) struct Moments<'m, T> {
    pub table: &'m Table,
    pub places: &'m Places<T>,
    pub weights: &'m Weights<T>,
    pub plain: &'m [T],
    pub signed: &'m [T],
}

/// Weights of far pairs and derivatives of 1/r between their cells, which a solve asks for again and again, in the parts that these are summed in.
pub(super) struct Derivatives<T: Number> {
    parts: Vec<Vec<T::Pack>>,
    spare: Spare<T::Pack>,
}

impl<T: Number> Derivatives<T> {
    pub fn new(
        table: &Table,
        places: &Places<T>,
        weights: &Weights<T>,
        pairs: &[Far],
        spare: &Spare<T::Pack>,
    ) -> Self {
        let of_one = |x: &Far, y: &Far| x.cells[0] == y.cells[0];
        let parts = in_parts(pairs, |_, pairs: &[Far]| {
            multipole::vectorized(
                #[inline(always)]
                || {
                    let mut d = vec![T::Pack::constant(0.0); table.derivatives()];
                    let packs = pairs.chunk_by(of_one).map(|all| all.len().div_ceil(WIDTH));
                    let mut out = spare.take(packs.sum::<usize>() * (1 + table.kept()));
                    for of_one in pairs.chunk_by(of_one) {
                        for pairs in of_one.chunks(WIDTH) {
                            let way = ways(places, pairs);
                            multipole::derivatives(table, &way, false, &mut d);
                            out.push(weights_of(weights, pairs));
                            out.extend_from_slice(&d[..table.kept()]);
                        }
                    }
                    out
                },
            )
        });
        Self {
            parts,
            spare: spare.clone(),
        }
    }

    /// Those of a part.
    pub fn part(&self, number: usize) -> &[T::Pack] {
        &self.parts[number]
    }
}

impl<T: Number> Drop for Derivatives<T> {
    fn drop(&mut self) {
        let parts = std::mem::take(&mut self.parts);
        parts.into_iter().for_each(|part| self.spare.give(part));
    }
}

/// The way from the second cell of each of some pairs to the first, the last pair again where there are fewer than stand side by side.
#[inline(always)]
fn ways<T: Number>(places: &Places<T>, pairs: &[Far]) -> [T::Pack; 3] {
    let mut out = [[T::constant(0.0); WIDTH]; 3];
    for i in 0..WIDTH {
        let [a, b] = pairs[i.min(pairs.len() - 1)].cells;
        let way = minus(&places.centres[a], &places.centres[b]);
        for (out, x) in out.iter_mut().zip(way) {
            out[i] = x;
        }
    }
    [T::pack(&out[0]), T::pack(&out[1]), T::pack(&out[2])]
}

/// The weight of each of some pairs, zero where there are fewer than stand side by side.
#[inline(always)]
fn weights_of<T: Number>(weights: &Weights<T>, pairs: &[Far]) -> T::Pack {
    let mut out = [T::constant(0.0); WIDTH];
    for (out, pair) in out.iter_mut().zip(pairs) {
        *out = weights.of(pair);
    }
    T::pack(&out)
}

impl<T: Number> Moments<'_, T> {
    /// What the cells of some pairs see of each other, with energies and their slopes if these are asked for; without slopes, by derivatives that are `known`.
    pub fn part(&self, pairs: &[Far], slopes: bool, known: Option<&[T::Pack]>) -> FarPart<T> {
        multipole::vectorized(
            #[inline(always)]
            || self.part_inlined(pairs, slopes, known),
        )
    }

    #[inline(always)]
    fn part_inlined(&self, pairs: &[Far], slopes: bool, known: Option<&[T::Pack]>) -> FarPart<T> {
        debug_assert!(!slopes || known.is_none(), "slopes need one more degree");
        let mut known = known.map(|known| known.chunks_exact(1 + self.table.kept()));
        let (table, n) = (self.table, self.table.moments());
        let zero = T::Pack::constant(0.0);
        let mut out = FarPart {
            seen: vec![T::constant(0.0); self.plain.len()],
            slopes: Vec::with_capacity(if slopes { pairs.len() } else { 0 }),
        };
        let mut d = vec![zero; table.derivatives()];
        let mut room = vec![zero; 4 * n + table.derivatives()];
        let (m, rest) = room.split_at_mut(n);
        let (l, rest) = rest.split_at_mut(n);
        let (seen_m, rest) = rest.split_at_mut(n);
        let (seen_l, both) = rest.split_at_mut(n);
        // Pairs of one cell stand together.
        for of_one in pairs.chunk_by(|x, y| x.cells[0] == y.cells[0]) {
            let a = of_one[0].cells[0];
            for (m, own) in m.iter_mut().zip(&self.plain[n * a..][..n]) {
                *m = T::pack(&[*own; WIDTH]);
            }
            seen_m.fill(zero);
            for pairs in of_one.chunks(WIDTH) {
                // The last pair again, weightless, where there are fewer.
                let mut others = [pairs[pairs.len() - 1].cells[1]; WIDTH];
                for (other, pair) in others.iter_mut().zip(pairs) {
                    *other = pair.cells[1];
                }
                let rows = others.map(|b| &self.signed[n * b..n * (b + 1)]);
                for (k, l) in l.iter_mut().enumerate() {
                    let mut column = [T::constant(0.0); WIDTH];
                    for (out, row) in column.iter_mut().zip(&rows) {
                        *out = row[k];
                    }
                    *l = T::pack(&column);
                }
                let weight = match known.as_mut() {
                    // As many as there are packs of pairs.
                    Some(known) => {
                        let known = known.next().unwrap_or_default();
                        multipole::unfold(table, &known[1..], &mut d);
                        known[0]
                    }
                    None => {
                        let way = ways(self.places, pairs);
                        multipole::derivatives(table, &way, slopes, &mut d);
                        weights_of(self.weights, pairs)
                    }
                };
                seen_l.fill(zero);
                multipole::see(table, &d, weight, [&*m, &*l], [&mut *seen_m, &mut *seen_l]);
                for (seen, sign) in seen_l.iter_mut().zip(table.signs()) {
                    *seen = *seen * *sign;
                }
                for (i, pair) in pairs.iter().enumerate() {
                    let own = out.seen[n * pair.cells[1]..][..n].iter_mut();
                    for (out, seen) in own.zip(&*seen_l) {
                        *out += T::lane(seen, i);
                    }
                }
                if slopes {
                    let (energy, slope) = multipole::energy(table, &d, [&*m, &*l], both);
                    for i in 0..pairs.len() {
                        let slope = [
                            T::lane(&slope[0], i),
                            T::lane(&slope[1], i),
                            T::lane(&slope[2], i),
                        ];
                        out.slopes.push((T::lane(&energy, i), slope));
                    }
                }
            }
            for (out, seen) in out.seen[n * a..][..n].iter_mut().zip(&*seen_m) {
                *out += T::sum(seen);
            }
        }
        out
    }
}

/// Adds what far pairs pull the cells' centres with.
pub(super) fn pull<T: Number>(
    pairs: &[Far],
    worth: &[(T, Triple<T>)],
    weights: &Weights<T>,
    centres: &mut [Triple<T>],
) {
    for (pair, (_, slope)) in pairs.iter().zip(worth) {
        let weight = weights.of(pair);
        let [a, b] = pair.cells;
        add(&mut centres[a], weight, slope);
        add(&mut centres[b], -weight, slope);
    }
}
