//! A tree of the bodies by their places.

use super::parts::FEW;
use crate::adjoint::lie::Vec3;
use std::ops::Range;

/// Bodies that lie together.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Its halves; none of a single body.
    pub halves: Option<[usize; 2]>,
    /// The cell that it is half of; its own number at the root.
    pub parent: usize,
    /// Its bodies, a range of [`Cells::order`].
    pub first: usize,
    pub count: usize,
}

/// A cell to be made.
struct Waiting {
    first: usize,
    count: usize,
    parent: usize,
    /// How many groups it holds; none of a part of one.
    groups: usize,
}

/// Cells, each before its halves. Which bodies lie in which is decided once, from where they are at the start, so that the energy stays a smooth function of their places
/// as these change.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    pub cells: Vec<Cell>,
    pub order: Vec<usize>,
    /// The cell of each body alone.
    pub leaf: Vec<usize>,
    /// That of all bodies of each group.
    pub roots: Vec<usize>,
}

impl Cells {
    /// Of bodies about these centres, halved across the longest side, each of so many equal `groups` by itself.
    pub fn new(centres: &[Vec3], groups: usize) -> Self {
        let mut out = Self {
            cells: Vec::with_capacity(2 * centres.len()),
            order: (0..centres.len()).collect(),
            leaf: vec![0; centres.len()],
            roots: Vec::with_capacity(groups),
        };
        if !centres.is_empty() {
            let mut waiting = vec![Waiting {
                first: 0,
                count: centres.len(),
                parent: 0,
                groups,
            }];
            while let Some(next) = waiting.pop() {
                out.add(centres, next, &mut waiting);
            }
        }
        out
    }

    fn add(&mut self, centres: &[Vec3], made: Waiting, waiting: &mut Vec<Waiting>) {
        let Waiting {
            first,
            count,
            parent,
            groups,
        } = made;
        let own = self.cells.len();
        // Its parent learns of it: the left half is made right after it.
        if own > 0 {
            let halves = &mut self.cells[parent].halves;
            *halves = Some(match *halves {
                None => [own, own],
                Some([left, _]) => [left, own],
            });
        }
        self.cells.push(Cell {
            halves: None,
            parent,
            first,
            count,
        });
        let mut halve = |half: usize, groups: [usize; 2]| {
            waiting.push(Waiting {
                first: first + half,
                count: count - half,
                parent: own,
                groups: groups[1],
            });
            waiting.push(Waiting {
                first,
                count: half,
                parent: own,
                groups: groups[0],
            });
        };
        if groups > 1 {
            halve(count / groups, [1, groups - 1]);
            return;
        }
        if groups == 1 {
            self.roots.push(own);
        }
        let bodies = &mut self.order[first..first + count];
        if let [b] = bodies {
            self.leaf[*b] = own;
            return;
        }
        let mut low = Vec3::repeat(f64::INFINITY);
        let mut high = -low;
        for b in bodies.iter() {
            low = low.inf(&centres[*b]);
            high = high.sup(&centres[*b]);
        }
        let axis = (high - low).imax();
        bodies.sort_by(|a, b| {
            let places = centres[*a][axis].total_cmp(&centres[*b][axis]);
            places.then(a.cmp(b))
        });
        halve(count / 2, [0, 0]);
    }

    /// The cells that a body lies in.
    pub fn around(&self, b: usize) -> Vec<usize> {
        let mut out = vec![self.leaf[b]];
        while let Some(last) = out.last().copied().filter(|i| *i != 0) {
            out.push(self.cells[last].parent);
        }
        out
    }

    /// A cell and all that is within it, which stand one after the other.
    pub fn within(&self, cell: usize) -> Range<usize> {
        cell..cell + 2 * self.cells[cell].count - 1
    }

    /// The halves of a cell whose bodies are worth more than one thread.
    pub fn split(&self, cell: usize) -> Option<[usize; 2]> {
        let Cell { halves, count, .. } = self.cells[cell];
        halves.filter(|_| count >= FEW)
    }

    /// The bodies of a cell.
    pub fn bodies(&self, cell: usize) -> &[usize] {
        let Cell { first, count, .. } = self.cells[cell];
        &self.order[first..first + count]
    }
}
