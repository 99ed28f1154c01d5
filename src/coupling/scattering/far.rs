//! Far pairs of cells, eight side by side.

use super::pairs::{Far, Weights};
use super::places::{Places, Triple, add, minus};
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

impl<T: Number> Moments<'_, T> {
    /// What the cells of some pairs see of each other, with energies and their slopes if these are asked for.
    pub fn part(&self, pairs: &[Far], slopes: bool) -> FarPart<T> {
        multipole::vectorized(
            #[inline(always)]
            || self.part_inlined(pairs, slopes),
        )
    }

    #[inline(always)]
    fn part_inlined(&self, pairs: &[Far], slopes: bool) -> FarPart<T> {
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
                let mut weights = [T::constant(0.0); WIDTH];
                for ((other, weight), pair) in others.iter_mut().zip(&mut weights).zip(pairs) {
                    *other = pair.cells[1];
                    *weight = self.weights.of(pair);
                }
                let mut ways = [[T::constant(0.0); WIDTH]; 3];
                for (i, b) in others.iter().enumerate() {
                    let way = minus(&self.places.centres[a], &self.places.centres[*b]);
                    for (ways, x) in ways.iter_mut().zip(way) {
                        ways[i] = x;
                    }
                }
                let way = [T::pack(&ways[0]), T::pack(&ways[1]), T::pack(&ways[2])];
                let rows = others.map(|b| &self.signed[n * b..n * (b + 1)]);
                for (k, l) in l.iter_mut().enumerate() {
                    let mut column = [T::constant(0.0); WIDTH];
                    for (out, row) in column.iter_mut().zip(&rows) {
                        *out = row[k];
                    }
                    *l = T::pack(&column);
                }
                multipole::derivatives(table, &way, slopes, &mut d);
                seen_l.fill(zero);
                let weight = T::pack(&weights);
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
