//! The coupled system at given poses, piece by piece, in the device's units: for comparisons and benchmarks.

use super::Gpu;
use super::geometry::PlacedSystem;
use super::solve::solves;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::Reached;
use crate::gpu::probe::Kernels;
use crate::solver::Columns;

/// The coupled system at given poses.
pub struct Probe(PlacedSystem);

impl Probe {
    /// At these poses.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Gpu, poses: &[Pose]) -> Result<Self> {
        Ok(Self(PlacedSystem::new(&gpu.geometry, poses)?))
    }

    /// Its kernels.
    pub fn kernels(&self) -> Kernels<'_> {
        Kernels::new(&self.0.surfaces)
    }

    /// The scene's size L (m), the weight w and the middle (m): the device has `K = w K̂`, `P = P̂/L`, positions from
    /// the middle over L.
    pub fn units(&self) -> (f64, f64, Vec3) {
        let (length, middle) = self.kernels().units();
        (length, self.0.geometry.weight, middle)
    }

    /// Solves `(K̂ᵀK̂ + D̂²) x = g`, D = w D̂.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    pub fn normal_solve(&self, g: &Columns) -> Result<(Columns, Reached)> {
        let (context, k) = (&self.0.surfaces.surfaces.context, g.columns);
        let right = context.upload("probe", context.fine(), &g.data)?;
        let x = context.zeros("probe", context.fine(), g.rows * k)?;
        let solves = solves(&self.0, "solve", (&right, k, 0), (&x, k, 0), k)?;
        let (reached, mut values) = solves.run(&[], &[], &[(&x, g.rows * k)])?;
        let out = Columns {
            rows: g.rows,
            columns: k,
            data: values.swap_remove(0),
        };
        Ok((out, reached))
    }
}
