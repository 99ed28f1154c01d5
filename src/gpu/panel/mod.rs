//! The coupled panels of [`crate::coupling::panel`] on the device.
//!
//! The CPU stores the blocks of A between bodies; here every entry is made where it is used. In the notation there: densities
//! `[φ, q]` by panel, μ by centroid, everything scaled as `geometry` says. Panels are what faces are to fundamental solutions, and their
//! centroids what sources are: A and S, which go from panels to centroids, are transposes of what the shaders call K and P.
//!
//! The flow ([`crate::coupling::Coupling::velocity`]) stays on the CPU.

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
use crate::coupling::full::{FullSolver, SystemBackend};
use crate::coupling::{CoupledResponse, PanelModel};
use crate::{Error, Result};
use geometry::{Geometry, PlacedPanels, Solution};
use nalgebra::DMatrix;
use std::sync::Arc;

/// The backend of [`crate::coupling::PanelCoupled`] on a device.
pub struct GpuPanels {
    name: String,
    geometry: Arc<Geometry>,
}

impl GpuPanels {
    /// Uploads a model to an open device.
    ///
    /// # Errors
    /// A solver that isn't there on the device, a device that fails, or too little memory.
    pub fn new(context: &Arc<Context>, model: &Arc<PanelModel>) -> Result<Self> {
        if model.settings.solver == FullSolver::Qr {
            return Err(Error::Unsupported {
                what: "the solver Qr with the method panel and the backend gpu".into(),
                why: "it needs the matrix, which the device doesn't store".into(),
                instead: "use the solver cgls or gmres, or the backend cpu".into(),
            });
        }
        Ok(Self {
            name: format!("gpu: {}", context.adapter().name),
            geometry: Arc::new(Geometry::new(context, model)?),
        })
    }

    /// As [`GpuPanels::new`], on a device opened for it.
    ///
    /// # Errors
    /// As there, and no fitting adapter.
    pub fn open(options: &Options, model: &Arc<PanelModel>) -> Result<Self> {
        Self::new(&Context::new(options)?, model)
    }

    /// The device.
    pub fn context(&self) -> &Arc<Context> {
        &self.geometry.surfaces.context
    }
}

impl SystemBackend for GpuPanels {
    fn name(&self) -> &str {
        &self.name
    }

    fn respond(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
    ) -> Result<Box<dyn CoupledResponse + '_>> {
        let placed = PlacedPanels::new(&self.geometry, poses)?;
        Ok(Box::new(Solution::new(Arc::new(placed), twists)?))
    }
}
