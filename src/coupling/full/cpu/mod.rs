//! The coupled system on the CPU: K assembled dense, and solved in memory.

mod first;
mod placed;
mod response;
mod second;
mod system;

use super::{Backend, Model, Response};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3};
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
    pub fn new(model: Arc<Model>) -> Self {
        Self {
            model,
            spare: Mutex::new(Vec::new()),
        }
    }
}

impl Backend for Cpu {
    fn name(&self) -> &str {
        "cpu"
    }

    fn respond(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Box<dyn Response + '_>> {
        Ok(Box::new(response::Answer::new(self, poses, twists)?))
    }
}

/// Three-vector `k` of row `j` in a `[j][columns][3]` array.
#[inline]
fn gradient_at(g: &[f64], columns: usize, j: usize, k: usize) -> Vec3 {
    let at = 3 * (j * columns + k);
    Vec3::new(g[at], g[at + 1], g[at + 2])
}
