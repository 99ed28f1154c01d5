//! The coupled system on the CPU: K assembled dense, and solved in memory.

mod first;
mod placed;
mod response;
mod second;
mod system;

use super::{Model, SystemBackend, SystemResponse};
use crate::adjoint::lie::{Pose, Vec3};
use crate::{Error, Result};
use nalgebra::DMatrix;
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
        if let Some(body) = model.bodies.iter().find(|b| !b.boundary.factored()) {
            return Err(Error::Unsupported {
                what: format!(
                    "body \"{}\" with {} faces on the backend cpu",
                    body.boundary.name,
                    body.faces()
                ),
                why: "its matrix wasn't made, and this backend needs it".into(),
                instead: "use the backend gpu, or fewer faces".into(),
            });
        }
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
    ) -> Result<Box<dyn SystemResponse + '_>> {
        Ok(Box::new(response::CoupledSolution::new(
            self, poses, twists,
        )?))
    }
}

/// Three-vector `k` of row `j` in a `[j][columns][3]` array.
#[inline]
fn gradient_at(g: &[f64], columns: usize, j: usize, k: usize) -> Vec3 {
    let at = 3 * (j * columns + k);
    Vec3::new(g[at], g[at + 1], g[at + 2])
}
