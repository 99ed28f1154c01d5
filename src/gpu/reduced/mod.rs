//! The fidelity of [`crate::coupling::reduced`] on the device, for many bodies or many points.
//!
//! The CPU forms I − LᵀGL and factors it: cubic in the number of bodies. Here nothing of the size of G is
//! stored: every entry is made where it is used, and the system is solved for all columns at once by conjugate
//! gradients in the fine arithmetic, which take a few iterations, for it is the identity and something small.
//! One more column, a fixed one with a part along every eigenvector, tells of a system that isn't positive
//! definite and of its condition number, whatever the others ask for.
//!
//! Where gaps are so narrow that there are films in them, the CPU answers instead.
//!
//! With images their own inverses, G is symmetric over all points, and the force on a point is what both columns'
//! charges pull with there: derivatives are a pass over G for the pulls, and sums over each body.

mod linearised;
mod products;
mod second;
mod solution;
mod solve;
mod sums;

pub use sums::GpuSums;

use super::batch::Batch;
use super::context::Context;
use super::points::{Compressed, PlacedPoints};
use crate::adjoint::lie::Pose;
use crate::boundary::PanelBoundary;
use crate::coupling::reduced::Reduced;
use crate::coupling::settings::check_asked;
use crate::coupling::{
    Coupling, Linearise, Linearised, Momenta, Motion, MotionBar, SurfacePotential, Together,
};
use crate::{Error, Result};
use linearised::Solved;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Residual of the coupled system, relative to its right-hand sides, unless another is asked for.
pub const TOLERANCE: f64 = 1e-10;

/// Compressed bodies coupled on a device: the same numbers as [`Reduced`]'s, to the tolerance of its solves.
///
/// Where [`Reduced`] compares the pivots of its factor, the condition number here is that of the Krylov space,
/// which comes closer to the true one from below.
pub struct GpuReduced {
    model: Arc<Compressed>,
    tolerance: f64,
}

impl GpuReduced {
    /// Uploads compressed bodies to an open device.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, reduced: impl Into<Arc<Reduced>>) -> Result<Self> {
        Ok(Self {
            model: Arc::new(Compressed::new(context, &reduced.into())?),
            tolerance: TOLERANCE,
        })
    }

    /// The same with another tolerance of its solves (relative to the right-hand sides).
    ///
    /// # Errors
    /// A tolerance that isn't between what the arithmetic resolves (1e-13) and 1.
    pub fn within(self, tolerance: f64) -> Result<Self> {
        if !(1e-13..1.0).contains(&tolerance) {
            return Err(Error::input(
                "settings: tolerance",
                tolerance,
                "must lie between 1e-13 and 1, e.g. 1e-10",
            ));
        }
        Ok(Self { tolerance, ..self })
    }

    /// The bodies, and what couples them.
    pub fn reduced(&self) -> &Arc<Reduced> {
        &self.model.reduced
    }

    /// The device.
    pub fn context(&self) -> &Arc<Context> {
        &self.model.context
    }
}

impl Coupling for GpuReduced {
    fn name(&self) -> &'static str {
        "the fidelity reduced on the GPU"
    }

    fn bodies(&self) -> usize {
        self.model.sizes.bodies
    }

    fn unknowns(&self) -> usize {
        self.model.sizes.modes
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        check_asked(self, poses, basis)?;
        if self.reduced().narrow(poses)? {
            return self.reduced().evaluate(poses, basis);
        }
        let placed = Arc::new(PlacedPoints::new(&self.model, poses)?);
        Ok(Solved::new(placed, self.tolerance, basis)?.value())
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        self.reduced().film_momenta(poses, twists)
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    fn together(&self, scenes: usize, columns: usize) -> Result<Option<Arc<dyn Together>>> {
        let made = Batch::new(self.context(), self.reduced(), scenes, columns)?;
        Ok(made.map(|batch| Arc::new(batch) as Arc<dyn Together>))
    }

    /// On the CPU.
    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        self.reduced().surface_potentials(motion, surfaces)
    }

    /// On the CPU.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        self.reduced()
            .surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for GpuReduced {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        check_asked(self, poses, basis)?;
        if self.reduced().narrow(poses)? {
            return self.reduced().linearise(poses, basis);
        }
        let placed = Arc::new(PlacedPoints::new(&self.model, poses)?);
        let solved = Solved::new(placed, self.tolerance, basis)?;
        Ok(Box::new(solved.linearise()?))
    }
}
