//! Sparse factors of symmetric matrices of islands of velocities, of which a few are tied: by contact, and by the films between bodies.

use super::Evaluation;
use super::island_matrix::IslandMatrix;
use crate::solver::{SparseCholesky, SparsePattern, elimination_order};
use nalgebra::{DMatrix, DVector};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Where the last matrix had entries, and what its factor fills: as a solve goes on, it is the same places that are tied.
#[derive(Default)]
pub(super) struct Places {
    entries: Vec<(usize, usize)>,
    pattern: Option<Arc<SparsePattern>>,
}

/// The entries of such a matrix on the free velocities, those of one place adding up.
pub(super) struct Tied {
    /// Of each velocity its number among the free ones.
    number: Vec<Option<usize>>,
    /// Free velocities that are eliminated together.
    groups: Vec<Vec<usize>>,
    entries: Vec<(usize, usize)>,
    values: Vec<[f64; 1]>,
}

/// A factor of it.
pub(super) struct TiedFactor(SparseCholesky<1>);

impl Tied {
    /// That of islands alone.
    pub fn new(islands: &IslandMatrix, velocities: usize, free: &[usize]) -> Self {
        let mut number = vec![None; velocities];
        for (k, i) in free.iter().enumerate() {
            number[*i] = Some(k);
        }
        let mut out = Self {
            number,
            groups: Vec::new(),
            entries: Vec::new(),
            values: Vec::new(),
        };
        for (rows, block) in islands.free_blocks(free) {
            for (k, i) in rows.iter().enumerate() {
                for (l, j) in rows.iter().enumerate().take(k + 1) {
                    out.put(*i, *j, block[(k, l)]);
                }
            }
            out.groups.push(rows);
        }
        out
    }

    /// Adds to the entry of two velocities, either of which may come first.
    pub fn add(&mut self, i: usize, j: usize, x: f64) {
        if let (Some(i), Some(j)) = (self.number[i], self.number[j]) {
            self.put(i, j, x);
        }
    }

    fn put(&mut self, i: usize, j: usize, x: f64) {
        self.entries.push((i.max(j), i.min(j)));
        self.values.push([x]);
    }

    /// Its factor; none where it isn't positive definite.
    pub fn factor(self, places: &mut Places) -> Option<TiedFactor> {
        if places.pattern.is_none() || places.entries != self.entries {
            let order = self.order()?;
            places.pattern = Some(Arc::new(SparsePattern::new(&order, &self.entries)?));
            places.entries = self.entries;
        }
        places
            .pattern
            .as_ref()?
            .factor(&self.values)
            .map(TiedFactor)
    }

    /// The order of elimination, in which groups that are tied to many others come last.
    fn order(&self) -> Option<Vec<usize>> {
        let mut group = vec![0; self.number.iter().flatten().count()];
        for (g, rows) in self.groups.iter().enumerate() {
            rows.iter().for_each(|i| group[*i] = g);
        }
        let ties = self.entries.iter().map(|(i, j)| (group[*i], group[*j]));
        let ties: BTreeSet<_> = ties.filter(|(a, b)| a != b).collect();
        let ties: Vec<_> = ties.into_iter().collect();
        let order = elimination_order(self.groups.len(), &ties)?;
        Some(order.iter().flat_map(|g| self.groups[*g].clone()).collect())
    }
}

impl TiedFactor {
    /// x with A x = `b`, of the free velocities.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let mut x: Vec<[f64; 1]> = b.iter().map(|x| [*x]).collect();
        self.0.solve(&mut x);
        DVector::from_iterator(b.len(), x.into_iter().flatten())
    }
}

impl Evaluation<'_> {
    /// The entries of what films between many bodies weigh, of unit velocities (kg, kg m, kg m²): each place once, several of one place adding up.
    pub(super) fn film_masses(&self, mut add: impl FnMut(usize, usize, f64)) {
        let Some(at) = self.scattered() else {
            return;
        };
        let density = self.parameters.density();
        let mut bodies = vec![0; self.system.coupling.bodies()];
        for (b, w) in self.system.submerged() {
            bodies[w] = b;
        }
        for (of, film) in at.films() {
            let (velocities, twists) =
                self.moving_bodies(&of.iter().map(|w| bodies[*w]).collect::<Vec<_>>());
            let own = density * twists.tr_mul(&(film * &twists));
            for (k, i) in velocities.iter().enumerate() {
                for (l, j) in velocities.iter().enumerate().take(k + 1) {
                    add(*i, *j, 0.5 * (own[(k, l)] + own[(l, k)]));
                }
            }
        }
    }

    /// Whether films between many bodies weigh anything.
    pub(super) fn has_films(&self) -> bool {
        (self.scattered()).is_some_and(|at| at.films().next().is_some())
    }

    /// The velocities that move some bodies, ascending, and the body-frame twists of all of these by each.
    fn moving_bodies(&self, bodies: &[usize]) -> (Vec<usize>, DMatrix<f64>) {
        let (tree, kinematics) = (&self.system.tree, &self.kinematics);
        let mut found: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
        for (place, b) in bodies.iter().enumerate() {
            for a in tree.carrying(*b) {
                for (column, k) in tree.links()[a].terms() {
                    let twist = kinematics.poses[*b].twist_to_body(&kinematics.columns[column]);
                    let none = || DVector::zeros(6 * bodies.len());
                    let mut rows = found.entry(k).or_insert_with(none).rows_mut(6 * place, 6);
                    rows += twist;
                }
            }
        }
        let (velocities, twists): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        match twists.is_empty() {
            true => (velocities, DMatrix::zeros(6 * bodies.len(), 0)),
            false => (velocities, DMatrix::from_columns(&twists)),
        }
    }
}
