//! Which cells see each other by their moments, and which bodies by their points.

use super::cells::Cells;
use super::levels::Levels;
use super::places::{Places, length, minus};
use crate::adjoint::multipole::Number;
use std::collections::BTreeSet;

/// Two cells that are no longer wholly seen by their moments: part of what they are to each other is that of their halves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blend {
    pub cells: [usize; 2],
    /// The blend whose halves' part it belongs to.
    pub within: Option<usize>,
    /// Whether both are single bodies.
    pub bodies: bool,
}

/// Two cells by their moments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Far {
    pub cells: [usize; 2],
    /// Their own blend, if they have one.
    pub own: Option<usize>,
    pub within: Option<usize>,
}

/// Two bodies point by point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub bodies: [usize; 2],
    pub within: Option<usize>,
    /// Its place in the list.
    pub number: usize,
}

/// All pairs at some poses.
#[derive(Clone, Debug, Default)]
pub(super) struct Pairs {
    pub far: Vec<Far>,
    pub near: Vec<Near>,
    /// Each after the one that it is within.
    pub blends: Vec<Blend>,
}

impl Pairs {
    /// At these places.
    pub fn new(
        cells: &Cells,
        refused: &BTreeSet<[usize; 2]>,
        places: &Places<f64>,
        apart: &Levels,
    ) -> Self {
        let mut out = Self::default();
        if cells.cells.is_empty() {
            return out;
        }
        // No image sees another.
        let bodies = cells.roots[0];
        let mut waiting: Vec<_> = (cells.roots.iter())
            .map(|root| ([bodies, *root], None))
            .collect();
        while let Some(([a, b], within)) = waiting.pop() {
            let (left, right) = (&cells.cells[a], &cells.cells[b]);
            if a == b {
                if let Some([l, r]) = left.halves {
                    waiting.extend([([l, r], within), ([r, r], within), ([l, l], within)]);
                }
                continue;
            }
            let ratio = ratio(places, [a, b]);
            let apart = apart.of(left.count == 1 && right.count == 1);
            let mut deeper = within;
            let hold = !refused.is_empty() && refused.contains(&[a.min(b), a.max(b)]);
            if ratio < apart.most && !hold {
                let blended = ratio > apart.sure;
                let own = blended.then_some(out.blends.len());
                out.far.push(Far {
                    cells: [a, b],
                    own,
                    within,
                });
                if !blended {
                    continue;
                }
                deeper = own;
                out.blends.push(Blend {
                    cells: [a, b],
                    within,
                    bodies: left.count == 1 && right.count == 1,
                });
            }
            // By numbers of bodies, which don't change: what is chosen by size would change suddenly.
            let first = left.count >= right.count;
            match if first { left.halves } else { right.halves } {
                Some([l, r]) if first => waiting.extend([([r, b], deeper), ([l, b], deeper)]),
                Some([l, r]) => waiting.extend([([a, r], deeper), ([a, l], deeper)]),
                None if hold => {}
                None => out.near.push(Near {
                    bodies: [cells.bodies(a)[0], cells.bodies(b)[0]],
                    within: deeper,
                    number: out.near.len(),
                }),
            }
        }
        out.far = together(out.far, cells.cells.len());
        out
    }

    /// What each blend leaves to the halves, all around it taken in, and its own weight of the moments, with its slope.
    pub fn weights<T: Number>(&self, places: &Places<T>, apart: &Levels) -> Weights<T> {
        let mut out = Weights {
            around: Vec::with_capacity(self.blends.len()),
            own: Vec::with_capacity(self.blends.len()),
        };
        for blend in &self.blends {
            let around = match blend.within {
                None => T::constant(1.0),
                Some(w) => out.left(w),
            };
            out.around.push(around);
            let apart = apart.of(blend.bodies);
            out.own.push(apart.weight(ratio(places, blend.cells)));
        }
        out
    }
}

/// Pairs of one first cell together, as they are summed, in the order in which they were found.
fn together(far: Vec<Far>, cells: usize) -> Vec<Far> {
    let mut next = vec![0; cells + 1];
    far.iter().for_each(|pair| next[pair.cells[0] + 1] += 1);
    for i in 0..cells {
        next[i + 1] += next[i];
    }
    let mut out = far.clone();
    for pair in far {
        let place = &mut next[pair.cells[0]];
        out[*place] = pair;
        *place += 1;
    }
    out
}

/// Weights of the blends.
pub(super) struct Weights<T> {
    /// That of the whole blend.
    pub around: Vec<T>,
    /// The part of its moments, with its slope in the ratio.
    pub own: Vec<[T; 2]>,
}

impl<T: Number> Weights<T> {
    /// What is left to the halves of blend `i`.
    pub fn left(&self, i: usize) -> T {
        self.around[i] * (T::constant(1.0) - self.own[i][0])
    }

    pub fn within(&self, within: Option<usize>) -> T {
        within.map_or(T::constant(1.0), |w| self.left(w))
    }

    pub fn of(&self, far: &Far) -> T {
        match far.own {
            None => self.within(far.within),
            Some(own) => self.around[own] * self.own[own][0],
        }
    }
}

/// Sum of the radii over the distance.
pub(super) fn ratio<T: Number>(places: &Places<T>, [a, b]: [usize; 2]) -> T {
    let r = minus(&places.centres[a], &places.centres[b]);
    let distance = length(&r);
    match distance.value() > 0.0 {
        true => (places.radii[a] + places.radii[b]) * distance.inverse(),
        false => T::constant(f64::MAX),
    }
}
