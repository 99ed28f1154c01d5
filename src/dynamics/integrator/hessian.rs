//! The Hessian M + Δt Jᵀ G J of the problem of contact on the free velocities, factored: as one matrix of a few velocities and of bodies that feel each other through
//! the water, else as a sparse one, in an order of elimination in which bodies that touch many others come last. Many bodies that are coupled by products press in what is
//! theirs alone, and all of that recoils in what they exchange.

use super::split::Split;
use crate::adjoint::solve::Definite;
use crate::dynamics::Evaluation;
use crate::dynamics::recoil::Recoiling;
use crate::solver::{SparseCholesky, SparsePattern, elimination_order};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Such a factor.
pub(super) enum Hessian<'a> {
    Alone(Factor),
    /// With the velocities that are free.
    Recoiling(Recoiling<'a>, Split),
}

/// That of bodies whose mass matrix is formed.
pub(super) enum Factor {
    Dense(Definite),
    Sparse(SparseCholesky<1>),
}

/// Where the last Hessian had entries, and what its factor fills: as a solve goes on, the same places press.
#[derive(Default)]
pub(super) struct Places {
    entries: Vec<(usize, usize)>,
    pattern: Option<Arc<SparsePattern>>,
}

impl<'a> Hessian<'a> {
    /// At the velocity `v` and the time step `dt` (s).
    ///
    /// # Errors
    /// A Hessian that isn't positive definite.
    pub fn new(
        e: &Evaluation<'a>,
        split: &Split,
        v: &DVector<f64>,
        dt: f64,
        places: &mut Places,
    ) -> Result<Self> {
        let found = match e.mass_blocks().is_whole() {
            true => dense(e, split, v, dt).map(Factor::Dense),
            false => sparse(e, split, v, dt, places).map(Factor::Sparse),
        };
        let factor = found.ok_or_else(|| Error::Solver {
            what: "contact".into(),
            iterations: 0,
            residual: f64::INFINITY,
            tolerance: 0.0,
            remedy: "the mass matrix isn't positive definite, or the stiffness is out of range"
                .into(),
        })?;
        let Some(at) = e.scattered() else {
            return Ok(Self::Alone(factor));
        };
        let free = split.clone();
        let own = move |right: &DVector<f64>| free.put(&factor.solve(&free.take(right)));
        let many = Recoiling::new(e, at, Box::new(own));
        Ok(Self::Recoiling(many, split.clone()))
    }

    /// `x = H⁻¹ b`, of the free velocities; H is symmetric, so that it is its own transpose's, too.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Alone(factor) => factor.solve(b),
            Self::Recoiling(many, split) => split.take(&many.solve(&split.put(b))),
        }
    }

    /// The same for a step of the search, where no matrix is formed to a relative residual, beside what earlier steps left; and what this leaves, in the units of
    /// [`Hessian::size`].
    pub fn step(&self, b: &DVector<f64>, behind: &[f64], goal: f64) -> (DVector<f64>, Vec<f64>) {
        match self {
            Self::Alone(factor) => (factor.solve(b), Vec::new()),
            Self::Recoiling(many, split) => {
                let (step, left) = many.step(&split.put(b), behind, goal);
                (split.take(&step), left)
            }
        }
    }

    /// Of a velocity, for what steps leave; zero where they leave nothing.
    pub fn size(&self, v: &DVector<f64>) -> f64 {
        match self {
            Self::Alone(_) => 0.0,
            Self::Recoiling(many, _) => many.size(v),
        }
    }

    /// [`Hessian::solve`] of every column.
    pub fn solve_columns(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        if let Self::Alone(Factor::Dense(factor)) = self {
            return factor.solve_columns(b);
        }
        let mut out = b.clone();
        for mut column in out.column_iter_mut() {
            let found = self.solve(&column.clone_owned());
            column.copy_from(&found);
        }
        out
    }
}

impl Factor {
    fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Dense(factor) => factor.solve(b),
            Self::Sparse(factor) => {
                let mut x: Vec<[f64; 1]> = b.iter().map(|x| [*x]).collect();
                factor.solve(&mut x);
                DVector::from_iterator(b.len(), x.into_iter().flatten())
            }
        }
    }
}

fn dense(e: &Evaluation, split: &Split, v: &DVector<f64>, dt: f64) -> Option<Definite> {
    let m = e.mass_blocks().dense() - dt * e.contact_jacobian(v);
    let m: DMatrix<f64> = 0.5 * (&m + m.transpose());
    Definite::new(split.block(&m))
}

fn sparse(
    e: &Evaluation,
    split: &Split,
    v: &DVector<f64>,
    dt: f64,
    places: &mut Places,
) -> Option<SparseCholesky<1>> {
    let mut number = vec![None; v.len()];
    for (k, i) in split.free.iter().enumerate() {
        number[*i] = Some(k);
    }
    let (mut entries, mut values) = (Vec::new(), Vec::new());
    let mut add = |i: usize, j: usize, x: f64| {
        entries.push((i.max(j), i.min(j)));
        values.push([x]);
    };
    // Rows of an island are eliminated together.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (rows, block) in e.mass_blocks().free_blocks(&split.free) {
        for (k, i) in rows.iter().enumerate() {
            for (l, j) in rows.iter().enumerate().take(k + 1) {
                add(*i, *j, block[(k, l)]);
            }
        }
        groups.push(rows);
    }
    e.contact_curvature(v, |i, j, x| {
        if let (Some(i), Some(j)) = (number[i], number[j]) {
            add(i, j, dt * x);
        }
    });
    if places.pattern.is_none() || places.entries != entries {
        let order = order(split.free.len(), &groups, &entries)?;
        places.pattern = Some(Arc::new(SparsePattern::new(&order, &entries)?));
        places.entries = entries;
    }
    places.pattern.as_ref()?.factor(&values)
}

/// The order of elimination of so many rows, by groups of them.
fn order(rows: usize, groups: &[Vec<usize>], entries: &[(usize, usize)]) -> Option<Vec<usize>> {
    let mut group = vec![0; rows];
    for (g, rows) in groups.iter().enumerate() {
        rows.iter().for_each(|i| group[*i] = g);
    }
    let ties: BTreeSet<_> = entries
        .iter()
        .map(|(i, j)| (group[*i], group[*j]))
        .collect();
    let ties: Vec<_> = ties.into_iter().filter(|(a, b)| a != b).collect();
    let order = elimination_order(groups.len(), &ties)?;
    Some(order.iter().flat_map(|g| groups[*g].clone()).collect())
}
