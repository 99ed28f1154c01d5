//! Answers to columns of twists.

use super::super::{Reached, SystemResponse};
use super::Cpu;
use super::placed::{PlacedBodies, Solution};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::{Direction, PairTensor, Tangent};
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Solution of the system at given poses, in memory.
pub(super) struct CoupledSolution<'a> {
    placed: Arc<PlacedBodies<'a>>,
    solution: Solution,
    /// Whether these are directions, of which there are few, and not the columns of a basis.
    few: bool,
}

impl<'a> CoupledSolution<'a> {
    /// Solves for columns of body-frame twists at the given poses.
    pub fn new(cpu: &'a Cpu, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Self> {
        let placed = PlacedBodies::new(cpu, poses, twists);
        Ok(Self {
            solution: placed.solve(twists.clone())?,
            placed: Arc::new(placed),
            few: false,
        })
    }
}

impl SystemResponse for CoupledSolution<'_> {
    fn reached(&self) -> Reached {
        self.solution.reached
    }

    fn momenta(&self) -> Result<DMatrix<f64>> {
        let s = &self.solution;
        let mut out = DMatrix::zeros(s.twists.nrows(), s.columns());
        for k in 0..s.columns() {
            let h = self.placed.impulse(&s.a.column(k), &s.mu.column(k));
            out.set_column(k, &h);
        }
        Ok(out)
    }

    fn energies(&self) -> Result<DMatrix<f64>> {
        let (k, a) = (self.solution.columns(), &self.solution.a);
        let g = self.placed.source_side(&self.solution.twists);
        Ok(DMatrix::from_fn(k, k, |i, j| {
            (0..g.rows).map(|s| g.at(s, i) * a.at(s, j)).sum::<f64>()
        }))
    }

    fn gradient(&self) -> Result<PairTensor> {
        Ok(if self.few {
            self.placed.few(&self.solution)
        } else {
            self.placed.tensor(&self.solution)
        })
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn SystemResponse + '_>> {
        let parts = directions.iter().map(|direction| match direction {
            Direction::Basis(c) => Ok(self.solution.combine(c)),
            Direction::Twist(x) => {
                let twists = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
                self.placed.solve(twists)
            }
        });
        let parts = parts.collect::<Result<Vec<_>>>()?;
        Ok(Box::new(Self {
            placed: self.placed.clone(),
            solution: Solution::beside(&parts),
            few: true,
        }))
    }

    fn tangent(&self, z: &[Vec6]) -> Result<Tangent> {
        match self.solution.columns() {
            1 | 2 => self.placed.second(&self.solution, z),
            k => Err(Error::input("tangent: columns", k, "must be 1 or 2")),
        }
    }

    fn strengths(&self) -> Result<Columns> {
        Ok(self.solution.a.clone())
    }
}
