//! The coupled system of [`crate::coupling::full`] on the device.
//!
//! In its notation, with everything scaled as `geometry` says: strengths `X = [a, λ]` by source,
//! densities `[μ, r, β]` by face, β = B x̄ and, to begin with, F x̄ where r will stand.

mod geometry;
mod probe;
mod response;
mod second;
mod solve;

// For tests and benches alone.
#[doc(hidden)]
pub use probe::Probe;

use super::context::{Context, Options};
use crate::adjoint::lie::Pose;
use crate::coupling::CoupledResponse;
use crate::coupling::full::{FullSolver, Model, SystemBackend};
use crate::{Error, Result};
use geometry::{Geometry, PlacedSystem, Solution};
use nalgebra::DMatrix;
use std::sync::Arc;

/// The backend of [`crate::coupling::full::Full`] on a device.
pub struct Gpu {
    name: String,
    geometry: Arc<Geometry>,
}

impl Gpu {
    /// Uploads a model to an open device.
    ///
    /// # Errors
    /// A solver that isn't there on the device, a device that fails, or too little memory.
    pub fn new(context: &Arc<Context>, model: &Arc<Model>) -> Result<Self> {
        if model.settings.solver != FullSolver::Cgls {
            return Err(Error::Unsupported {
                what: format!(
                    "the solver {:?} with the backend gpu",
                    model.settings.solver
                ),
                why: "it needs the matrix, which the device doesn't store".into(),
                instead: "use the solver cgls, or the backend cpu".into(),
            });
        }
        Ok(Self {
            name: format!("gpu: {}", context.adapter().name),
            geometry: Arc::new(Geometry::new(context, model)?),
        })
    }

    /// As [`Gpu::new`], on a device opened for it.
    ///
    /// # Errors
    /// As there, and no fitting adapter.
    pub fn open(options: &Options, model: &Arc<Model>) -> Result<Self> {
        Self::new(&Context::new(options)?, model)
    }

    /// The device.
    pub fn context(&self) -> &Arc<Context> {
        &self.geometry.surfaces.context
    }
}

impl SystemBackend for Gpu {
    fn name(&self) -> &str {
        &self.name
    }

    fn respond(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
    ) -> Result<Box<dyn CoupledResponse + '_>> {
        let placed = PlacedSystem::new(&self.geometry, poses)?;
        Ok(Box::new(Solution::new(Arc::new(placed), twists)?))
    }
}
