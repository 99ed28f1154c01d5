//! The transpose of an implicit stage.

use super::rule::Rule;
use super::split::Split;
use super::stage_factor::{StageFactor, StageMatrix};
use super::stage_matrix::stage_matrix;
use super::start::Start;
use crate::dynamics::Linearisation;
use crate::dynamics::island_matrix::IslandMatrix;
use crate::solver::{Columns, Outcome, gmres};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;

/// What is left of the transposed equation of many bodies, of what it starts from, and what is accepted where no more is to be had: it holds the water's own solves.
const TOLERANCE: f64 = 1e-10;
const ENOUGH: f64 = 1e-8;
const ITERATIONS: usize = 60;

/// What the derivatives of a stage need.
pub(super) struct AdjointStage<'a> {
    /// Velocity, control, and momentum p̂ + h f.
    v: DVector<f64>,
    control: DVector<f64>,
    reached: DVector<f64>,
    rule: Rule,
    /// What is added to the diagonal of ∂f/∂v at that velocity, where some forces are late.
    late: Option<DVector<f64>>,
    /// ∂f/∂v and the stage's matrix, where they are formed.
    formed: Option<[IslandMatrix; 2]>,
    /// Factor of the transposed matrix: all of it where it is formed.
    factor: Option<StageFactor<'a>>,
}

impl<'a> AdjointStage<'a> {
    /// Of a step's stage at `e`, with velocity v and momentum p̂ + h f.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn new(
        start: &Start<'_, 'a>,
        e: &Linearisation<'a>,
        v: &DVector<f64>,
        reached: &DVector<f64>,
        rule: Rule,
    ) -> Result<Self> {
        let control = &start.input.control;
        let made = StageMatrix::new(start, e, v, rule)?;
        let matrix = made.matrix(v, reached, rule);
        let factor = made.factored(start.split, &matrix, true);
        Ok(Self {
            late: made.late,
            v: v.clone(),
            control: control.clone(),
            reached: reached.clone(),
            rule,
            formed: e.scattered().is_none().then_some([made.rates, matrix]),
            factor,
        })
    }

    /// ∂f/∂v and the stage's matrix, formed.
    ///
    /// # Errors
    /// A solve of the coupling.
    fn formed(&self, e: &Linearisation) -> Result<[IslandMatrix; 2]> {
        if let Some(formed) = &self.formed {
            return Ok(formed.clone());
        }
        let mut rates = e.force_velocity_blocks(&self.v, &self.control)?;
        let late = self.late.iter().flat_map(|late| late.iter().enumerate());
        rates.subtract(late.map(|(i, x)| (i, i, -x)));
        let inertia = IslandMatrix::whole(e.mass_matrix().clone());
        e.check()?;
        let matrix = stage_matrix(e, &inertia, &self.v, &rates, &self.reached, self.rule);
        Ok([rates, matrix])
    }

    /// The stage's matrix.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn matrix(&self, e: &Linearisation) -> Result<DMatrix<f64>> {
        Ok(self.formed(e)?[1].dense())
    }

    /// (∂f/∂v)ᵀ z.
    ///
    /// # Errors
    /// A solve of the coupling.
    pub fn rates_vjp(&self, e: &Linearisation, z: &DVector<f64>) -> Result<DVector<f64>> {
        match &self.formed {
            Some([rates, _]) => Ok(rates.tr_times(z)),
            None => {
                let mean = e.force_vjp(&self.v, &self.control, z)?.v;
                let late = self.late.iter().map(|late| late.component_mul(z));
                Ok(late.fold(mean, |sum, late| sum + late))
            }
        }
    }

    /// dv, zero on driven entries, with stage matrix · dv_f = right_f: the factor is of all columns.
    ///
    /// # Errors
    /// A singular matrix.
    pub fn solve_jvp(
        &self,
        e: &Linearisation,
        split: &Split,
        right: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>> {
        solve_columns(&self.formed(e)?[1], split, right)
    }

    /// w_f with (stage matrix)ᵀ w_f = v̄_f, zero on driven entries.
    ///
    /// # Errors
    /// A singular matrix, or a solve that misses its tolerance.
    pub fn solve(
        &self,
        e: &Linearisation,
        split: &Split,
        v_bar: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        if split.free.is_empty() {
            return Ok(DVector::zeros(v_bar.len()));
        }
        let factor = self.factor.as_ref().ok_or_else(|| singular("adjoint"))?;
        let right = split.take(v_bar);
        let found = match &self.formed {
            Some(_) => factor
                .solve(&right, None)
                .ok_or_else(|| singular("adjoint"))?,
            None => self.solve_by_products(e, split, factor, &right)?,
        };
        Ok(split.put(&found))
    }

    /// (Stage matrix)ᵀ w.
    fn transposed(&self, e: &Linearisation, w: &DVector<f64>) -> Result<DVector<f64>> {
        let xi = self.rule.reach * &self.v;
        let tree = &e.system.tree;
        let [_, xi_bar, hat_bar] = tree.chart_momentum_vjp(&e.q, &xi, &self.reached, w);
        let z = self.rule.impulse_back(e, &hat_bar);
        Ok(e.mass_times(w) - self.rates_vjp(e, &z)? - self.rule.reach * xi_bar)
    }

    fn solve_by_products(
        &self,
        e: &Linearisation,
        split: &Split,
        factor: &StageFactor,
        right: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        // Rows in units of about the root of their inertia.
        let scale = split.scale(&e.mass_blocks().diagonal());
        let apply = |v: &DVector<f64>| {
            let v = v.component_div(&scale);
            let w = factor.solve(&v, None);
            let w = w.ok_or_else(|| singular("adjoint"))?;
            let moved = self.transposed(e, &split.put(&w))?;
            Ok([w, split.take(&moved).component_mul(&scale)])
        };
        let found = krylov(apply, &right.component_mul(&scale), TOLERANCE)?;
        e.check()?;
        if found.residual.is_nan() || found.residual > ENOUGH {
            return Err(Error::Solver {
                what: "adjoint of an implicit stage".into(),
                iterations: found.iterations,
                residual: found.residual,
                tolerance: TOLERANCE,
                remedy: "take a smaller time step".into(),
            });
        }
        Ok(DVector::from_vec(found.x.data))
    }
}

/// [`gmres`] of one column, `apply` taking v to `[M⁻¹ v, A M⁻¹ v]`.
///
/// # Errors
/// What `apply` fails with first.
pub(super) fn krylov(
    apply: impl Fn(&DVector<f64>) -> Result<[DVector<f64>; 2]>,
    right: &DVector<f64>,
    tolerance: f64,
) -> Result<Outcome> {
    let failed = RefCell::new(None);
    let column = |x: &DVector<f64>| Columns {
        rows: x.len(),
        columns: 1,
        data: x.as_slice().to_vec(),
    };
    let tried = |v: &Columns, _: &[usize]| {
        let v = DVector::from_column_slice(&v.data);
        match apply(&v) {
            Ok(both) => both.map(|x| column(&x)),
            Err(error) => {
                failed.borrow_mut().get_or_insert(error);
                [column(&v), column(&(f64::NAN * &v))]
            }
        }
    };
    let found = gmres(tried, &column(right), tolerance, ITERATIONS, ITERATIONS);
    failed.into_inner().map_or(Ok(found), Err)
}

/// Columns dv, zero on driven rows, with `matrix` · dv_f = right_f.
pub(super) fn solve_columns(
    matrix: &IslandMatrix,
    split: &Split,
    right: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    if split.free.is_empty() {
        return Ok(DMatrix::zeros(right.nrows(), right.ncols()));
    }
    let factor = matrix.factored(&split.free, false);
    let solution = factor.solve_columns(&split.take_rows(right));
    Ok(split.put_rows(&solution.ok_or_else(|| singular("tangent"))?))
}

fn singular(what: &str) -> Error {
    Error::Solver {
        what: format!("{what} of an implicit stage"),
        iterations: 0,
        residual: f64::INFINITY,
        tolerance: 0.0,
        remedy: "the stage matrix is singular: take a smaller time step".into(),
    }
}
