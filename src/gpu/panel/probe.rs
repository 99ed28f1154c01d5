//! The coupled panels at given poses, kernel by kernel: for comparisons and benchmarks.

use super::GpuPanels;
use super::geometry::PlacedPanels;
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::gpu::probe::Kernels;

/// The coupled panels at given poses.
pub struct Probe(PlacedPanels);

impl Probe {
    /// At these poses.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &GpuPanels, poses: &[Pose]) -> Result<Self> {
        Ok(Self(PlacedPanels::new(&gpu.geometry, poses)?))
    }

    /// Its kernels: of K the double layers and ½ of every panel itself, of P the single layers between bodies.
    pub fn kernels(&self) -> Kernels<'_> {
        Kernels::new(&self.0.surfaces)
    }
}
