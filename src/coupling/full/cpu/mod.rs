//! The coupled system on the CPU: K assembled dense, and solved in memory.

mod first;
mod placed;
mod second;
mod strengths;
mod system;

use super::{FullSolver, Model, SystemBackend};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::{CoupledResponse, Direction, PairTensor, Reached, Tangent};
use crate::memory;
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use placed::{PlacedBodies, Solution};
use std::sync::{Arc, Mutex};

/// The backend that every machine has.
pub struct Cpu {
    model: Arc<Model>,
    /// Matrices to be used again: fresh memory costs as much as filling it.
    spare: Mutex<Vec<Vec<f64>>>,
}

impl Cpu {
    /// For a model.
    ///
    /// # Errors
    /// A body that was never factored: this backend stores its matrix.
    pub fn new(model: Arc<Model>) -> Result<Self> {
        if let Some(body) = model.bodies.iter().find(|b| !b.factored()) {
            return Err(Error::Unsupported {
                what: format!(
                    "body \"{}\" with {} faces on the backend cpu",
                    body.name,
                    body.faces.len()
                ),
                why: "its matrix wasn't made, and this backend needs it".into(),
                instead: "use the backend gpu, or fewer faces".into(),
            });
        }
        let (rows, columns) = (model.rows() as f64, model.columns() as f64);
        // Matrices at two configurations, or one that is factored with its damping.
        let numbers = match model.settings.solver {
            FullSolver::Qr => rows * columns + 2.0 * (rows + columns) * columns,
            _ => 2.0 * rows * columns,
        };
        memory::fits(
            &format!("coupling bodies with {rows} faces by fundamental solutions"),
            memory::numbers(numbers),
            "use fewer faces, or the fidelity reduced",
        )?;
        Ok(Self {
            model,
            spare: Mutex::new(Vec::new()),
        })
    }
}

impl SystemBackend for Cpu {
    fn name(&self) -> &str {
        "cpu"
    }

    fn respond(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
    ) -> Result<Box<dyn CoupledResponse + '_>> {
        let placed = PlacedBodies::new(self, poses, twists);
        Ok(Box::new(CoupledSolution {
            solution: placed.solve(twists.clone())?,
            placed: Arc::new(placed),
            few: false,
        }))
    }
}

/// Solution of the system at given poses, in memory.
struct CoupledSolution<'a> {
    placed: Arc<PlacedBodies<'a>>,
    solution: Solution,
    /// Whether these are directions, of which there are few, and not the columns of a basis.
    few: bool,
}

impl CoupledResponse for CoupledSolution<'_> {
    fn reached(&self) -> Reached {
        self.solution.reached
    }

    fn momenta(&self) -> Result<DMatrix<f64>> {
        let Solution { twists, solved, .. } = &self.solution;
        let mut out = DMatrix::zeros(twists.nrows(), twists.ncols());
        for (k, mut column) in out.column_iter_mut().enumerate() {
            column.copy_from(&self.placed.impulse(solved, k));
        }
        Ok(out)
    }

    fn energies(&self) -> Result<DMatrix<f64>> {
        let (k, a) = (self.solution.columns(), &self.solution.solved.a);
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

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>> {
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

    fn densities(&self) -> Result<Columns> {
        Ok(self.solution.solved.a.clone())
    }

    fn density_rates(&self, z: &[Vec6]) -> Result<Columns> {
        self.placed.strength_rates(&self.solution, z)
    }
}
