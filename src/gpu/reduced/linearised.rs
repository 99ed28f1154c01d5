//! One evaluation on the device, and its derivatives.

use super::solution::Solution;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::{
    CouplingReport, Direction, Linearised, Momenta, PairTensor, Pullback, Tangent,
};
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::combine;
use crate::gpu::points::PlacedPoints;
use crate::gpu::units;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Most columns of which the derivatives of all pairs are kept: with more, those asked for are made.
const TENSOR: usize = 24;

/// [`GpuReduced`](super::GpuReduced) solved for a basis.
pub(super) struct Solved {
    solution: Solution,
    tolerance: f64,
    report: CouplingReport,
}

/// The same with its derivatives.
pub(super) struct GpuLinearised {
    solved: Solved,
    derivative: Derivative,
}

/// First derivatives on the basis.
enum Derivative {
    /// Of all pairs of columns.
    Pairs(PairTensor),
    /// What the columns pull with.
    Pulls(Buffer),
}

impl Solved {
    pub fn new(placed: Arc<PlacedPoints>, tolerance: f64, basis: &DMatrix<f64>) -> Result<Self> {
        let solution = Solution::solve(placed, basis, tolerance, true)?;
        let (reduced, reached) = (&solution.placed.model.reduced, &solution.reached);
        let poses: &[Pose] = &solution.placed.poses;
        reduced.check_solution(poses, basis, &solution.momenta, reached.condition)?;
        let report = CouplingReport {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: 0.0,
            condition: reached.condition,
        };
        Ok(Self {
            solution,
            tolerance,
            report,
        })
    }

    /// The value alone.
    pub fn value(self) -> Momenta {
        Momenta::new(self.solution.momenta, self.report)
    }

    pub fn linearise(self) -> Result<GpuLinearised> {
        let solution = &self.solution;
        let derivative = match solution.columns {
            0 => Derivative::Pairs(PairTensor::zeros(solution.placed.model.sizes.bodies, 0)),
            k if k <= TENSOR => Derivative::Pairs(solution.tensor(&solution.pulls()?)?),
            _ => Derivative::Pulls(solution.pulls()?),
        };
        Ok(GpuLinearised {
            solved: self,
            derivative,
        })
    }
}

impl GpuLinearised {
    fn bodies(&self) -> usize {
        self.solved.solution.placed.model.sizes.bodies
    }

    /// Columns on the basis and what they pull with.
    fn along(&self, pulls: &Buffer, x: &DVector<f64>) -> Result<(Solution, Buffer)> {
        let coefficients = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
        let (one, units) = self.solved.solution.combination(&coefficients)?;
        let model = &one.placed.model;
        let context = &model.context;
        let rows = (model.sizes.points, model.pull());
        let out = context.reals("pulls", context.fine(), rows.0 * rows.1)?;
        let call = combine(context, pulls, &units, &out, rows)?;
        context.submit([&call])?;
        Ok((one, out))
    }

    /// ∇_g E(x, e_i) of every column, `[column][body]`.
    fn columns(&self, pulls: &Buffer, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        let (one, own) = self.along(pulls, x)?;
        let found = self.solved.solution.wrenches(pulls, (&one, &own))?;
        let of = |k: usize| (0..self.bodies()).map(|b| found[b][k]).collect();
        Ok((0..self.solved.solution.columns).map(of).collect())
    }

    /// ∇_g E(x, y).
    fn pair(&self, pulls: &Buffer, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let ((x, of_x), (y, of_y)) = (self.along(pulls, x)?, self.along(pulls, y)?);
        Ok(x.wrenches(&of_x, (&y, &of_y))?.concat())
    }

    /// The solutions to directions: combinations of what is there, or another solve.
    fn solutions(&self, directions: &[Direction]) -> Result<Solution> {
        match self.solved.solution.twists.along(directions) {
            Ok(coefficients) => Ok(self.solved.solution.combination(&coefficients)?.0),
            Err(twists) => {
                let placed = self.solved.solution.placed.clone();
                Solution::solve(placed, &twists, self.solved.tolerance, false)
            }
        }
    }
}

impl Linearised for GpuLinearised {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.solved.solution.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        match &self.derivative {
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
            Derivative::Pairs(tensor) => Ok(tensor.along(y, z)),
            Derivative::Pulls(pulls) => {
                let all = self.columns(pulls, y)?;
                let dot = |w: &Vec<Vec6>| w.iter().zip(z).map(|(w, z)| w.dot(z)).sum();
                Ok(DVector::from_iterator(y.len(), all.iter().map(dot)))
            }
        }
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let solution = self.solutions(&Direction::distinct(x, y))?;
        let last = solution.columns - 1;
        let pulls = solution.pulls()?;
        let wrenches = solution.wrenches(&pulls, (&solution, &pulls))?;
        Ok(Pullback {
            momentum_x: solution.momenta.column(0).into_owned(),
            momentum_y: solution.momenta.column(last).into_owned(),
            wrench: wrenches.iter().map(|pairs| pairs[last]).collect(),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let solution = self.solutions(&Direction::distinct(x, y))?;
        let length = solution.placed.model.length;
        units::along(z, length, |z| solution.second(z, self.solved.tolerance))
    }

    fn report(&self) -> &CouplingReport {
        &self.solved.report
    }
}
