//! One evaluation on the device.

use super::answer::Answer;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::{Direction, PairTensor, Pullback, Record, Report, Tangent};
use crate::gpu::buffer::Buffer;
use crate::gpu::combine::combine;
use crate::gpu::points::Placed;
use crate::gpu::units;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Most columns of which the derivatives of all pairs are kept: with more, those asked for are made.
const TENSOR: usize = 24;

/// Record of [`GpuReduced`](super::GpuReduced).
pub(super) struct GpuRecord {
    answer: Answer,
    tolerance: f64,
    derivative: Derivative,
    report: Report,
}

/// First derivatives on the basis.
enum Derivative {
    None,
    /// Of all pairs of columns.
    Pairs(PairTensor),
    /// What the columns pull with.
    Pulls(Buffer),
}

impl GpuRecord {
    pub fn new(
        placed: Arc<Placed>,
        tolerance: f64,
        basis: &DMatrix<f64>,
        derivative: bool,
    ) -> Result<Self> {
        let answer = Answer::solve(placed, basis, tolerance, true)?;
        let (reduced, reached) = (&answer.placed.model.reduced, &answer.reached);
        let poses: &[Pose] = &answer.placed.poses;
        reduced.check_answer(poses, basis, &answer.momenta, reached.condition)?;
        let report = Report {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: 0.0,
            condition: reached.condition,
        };
        let derivative = match (derivative, answer.columns) {
            (false, _) | (_, 0) => Derivative::None,
            (_, k) if k <= TENSOR => Derivative::Pairs(answer.tensor(&answer.pulls()?)?),
            _ => Derivative::Pulls(answer.pulls()?),
        };
        Ok(Self {
            answer,
            tolerance,
            derivative,
            report,
        })
    }

    fn bodies(&self) -> usize {
        self.answer.placed.model.sizes.bodies
    }

    /// Columns on the basis and what they pull with.
    fn along(&self, pulls: &Buffer, x: &DVector<f64>) -> Result<(Answer, Buffer)> {
        let coefficients = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
        let one = self.answer.combination(&coefficients)?;
        let model = &one.placed.model;
        let context = &model.context;
        let rows = (model.sizes.points, model.pull());
        let out = context.reals("pulls", context.fine(), rows.0 * rows.1)?;
        let units = self.answer.units(&coefficients, &one.scale);
        let call = combine(context, context.fine(), pulls, &units, &out, rows)?;
        context.run(&[&[call]])?;
        Ok((one, out))
    }

    /// ∇_g E(x, e_i) of every column, `[column][body]`.
    fn columns(&self, pulls: &Buffer, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        let (one, own) = self.along(pulls, x)?;
        let found = self.answer.wrenches(pulls, (&one, &own))?;
        let of = |k: usize| (0..self.bodies()).map(|b| found[b][k]).collect();
        Ok((0..self.answer.columns).map(of).collect())
    }

    /// ∇_g E(x, y).
    fn pair(&self, pulls: &Buffer, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let ((x, of_x), (y, of_y)) = (self.along(pulls, x)?, self.along(pulls, y)?);
        Ok(x.wrenches(&of_x, (&y, &of_y))?.concat())
    }

    /// The answers to directions: combinations of what is there, or another solve.
    fn answers(&self, directions: &[Direction]) -> Result<Answer> {
        let n = directions.len();
        let mut coefficients = DMatrix::zeros(self.answer.columns, n);
        let mut twists = DMatrix::zeros(self.answer.twists.nrows(), n);
        let mut combined = true;
        for (k, direction) in directions.iter().enumerate() {
            match direction {
                Direction::Basis(c) => {
                    coefficients.set_column(k, c);
                    twists.set_column(k, &(&self.answer.twists * *c));
                }
                Direction::Twist(x) => {
                    combined = false;
                    twists.set_column(k, x);
                }
            }
        }
        if combined {
            return self.answer.combination(&coefficients);
        }
        Answer::solve(self.answer.placed.clone(), &twists, self.tolerance, false)
    }
}

impl Record for GpuRecord {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.answer.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        match &self.derivative {
            Derivative::None => Ok(vec![Vec6::zeros(); self.bodies()]),
            Derivative::Pairs(tensor) => Ok(tensor.contract(x, y)),
            Derivative::Pulls(pulls) => self.pair(pulls, x, y),
        }
    }

    fn gradient_columns(&self, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        let unit = |i: usize| DVector::from_fn(x.len(), |k, _| f64::from(u8::from(k == i)));
        match &self.derivative {
            Derivative::Pulls(pulls) => self.columns(pulls, x),
            _ => (0..x.len()).map(|i| self.gradient(x, &unit(i))).collect(),
        }
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        match &self.derivative {
            Derivative::None => Ok(DVector::zeros(y.len())),
            Derivative::Pairs(tensor) => Ok(tensor.along(y, z)),
            Derivative::Pulls(pulls) => {
                let all = self.columns(pulls, y)?;
                let dot = |w: &Vec<Vec6>| w.iter().zip(z).map(|(w, z)| w.dot(z)).sum();
                Ok(DVector::from_iterator(y.len(), all.iter().map(dot)))
            }
        }
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let answer = self.answers(&Direction::distinct(x, y))?;
        let last = answer.columns - 1;
        let pulls = answer.pulls()?;
        let wrenches = answer.wrenches(&pulls, (&answer, &pulls))?;
        Ok(Pullback {
            momentum_x: answer.momenta.column(0).into_owned(),
            momentum_y: answer.momenta.column(last).into_owned(),
            wrench: wrenches.iter().map(|pairs| pairs[last]).collect(),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let answer = self.answers(&Direction::distinct(x, y))?;
        let length = answer.placed.model.length;
        units::along(z, length, |z| answer.second(z, self.tolerance))
    }

    fn report(&self) -> &Report {
        &self.report
    }
}
