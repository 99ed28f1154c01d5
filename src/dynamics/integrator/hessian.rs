//! The Hessian M + Δt Jᵀ G J of the problem of contact on the free velocities, with what resists motion beside it, factored: as one matrix of a few velocities and of bodies that feel each
//! other through
//! the water, else as a sparse one, in an order of elimination in which bodies that touch many others come last. Many bodies that are coupled by products press in what is
//! theirs alone, films between them weighing with it, and all of that recoils in what else they exchange.

use super::reaction::Reaction;
use super::split::Split;
use crate::adjoint::solve::Definite;
use crate::dynamics::Evaluation;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::dynamics::recoil::{Own, Recoiling};
use crate::dynamics::tied::{Places, Tied, TiedFactor};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Such a factor.
pub(super) enum Hessian<'a> {
    Alone(Factor),
    /// With the velocities that are free.
    Recoiling(Recoiling<'a>, Split),
}

/// That of bodies whose mass matrix is formed.
pub(super) enum Factor {
    Dense(Definite),
    Sparse(TiedFactor),
}

impl<'a> Hessian<'a> {
    /// At the velocity `v` and the time step `dt` (s).
    ///
    /// # Errors
    /// A Hessian that isn't positive definite.
    pub fn new(
        e: &Evaluation<'a>,
        split: &Split,
        reaction: &Reaction,
        v: &DVector<f64>,
        dt: f64,
        places: &mut Places,
    ) -> Result<Self> {
        let resisted = reaction.resistance_matrix(v);
        let resisted = resisted.as_ref();
        let mut factored = |films| match e.mass_blocks().is_whole() {
            true => dense(e, split, resisted, v, dt, films).map(Factor::Dense),
            false => sparse(e, split, resisted, v, dt, films, places).map(Factor::Sparse),
        };
        let filmed = e.has_films().then(|| factored(true)).flatten();
        let films = filmed.is_some();
        let factor = filmed
            .or_else(|| factored(false))
            .ok_or_else(|| Error::Solver {
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
        let many = Recoiling::new(e, at, Own::new(films, own));
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

    /// The same where what the bodies exchange stays as it is.
    pub fn alone(&self, b: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Alone(factor) => factor.solve(b),
            Self::Recoiling(many, split) => split.take(&many.alone(&split.put(b))),
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
            Self::Sparse(factor) => factor.solve(b),
        }
    }
}

fn dense(
    e: &Evaluation,
    split: &Split,
    resisted: Option<&IslandMatrix>,
    v: &DVector<f64>,
    dt: f64,
    films: bool,
) -> Option<Definite> {
    let mut m = e.mass_blocks().dense() - dt * e.contact_jacobian(v);
    if let Some(resisted) = resisted {
        m -= dt * resisted.dense();
    }
    let mut m: DMatrix<f64> = 0.5 * (&m + m.transpose());
    if films {
        e.film_masses(|i, j, x| {
            m[(i, j)] += x;
            if i != j {
                m[(j, i)] += x;
            }
        });
    }
    Definite::new(split.block(&m))
}

fn sparse(
    e: &Evaluation,
    split: &Split,
    resisted: Option<&IslandMatrix>,
    v: &DVector<f64>,
    dt: f64,
    films: bool,
    places: &mut Places,
) -> Option<TiedFactor> {
    let mut matrix = Tied::new(e.mass_blocks(), v.len(), &split.free);
    e.contact_curvature(v, |i, j, x| matrix.add(i, j, dt * x));
    if let Some(resisted) = resisted {
        resisted.lower(|i, j, x| matrix.add(i, j, -dt * x));
    }
    if films {
        e.film_masses(|i, j, x| matrix.add(i, j, x));
    }
    matrix.factor(places)
}
