//! All seats as one coupling: whoever asks, asks from the seat of the member that runs on the thread.

use super::crew::seat;
use super::question::Kind;
use super::seat::Seat;
use super::solved::SolvedTogether;
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::boundary::PanelBoundary;
use crate::coupling::reduced::Reduced;
use crate::coupling::{
    Coupling, Linearise, Linearised, Momenta, Motion, MotionBar, SurfacePotential,
};
use nalgebra::DMatrix;
use std::sync::Arc;

/// The fidelity reduced of many equal scenes.
pub(super) struct Seats {
    pub seats: Vec<Seat>,
    pub reduced: Arc<Reduced>,
}

impl Seats {
    /// The seat of the member that runs on this thread.
    fn own(&self) -> Option<&Seat> {
        self.seats.get(seat()?)
    }
}

impl Coupling for Seats {
    fn name(&self) -> &'static str {
        "the fidelity reduced on the GPU, of many scenes together"
    }

    fn bodies(&self) -> usize {
        self.reduced.bodies()
    }

    fn unknowns(&self) -> usize {
        self.reduced.unknowns()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        if let Some(seat) = self.own()
            && let Some((_, found)) = seat.solve(Kind::Value, poses, basis)?
        {
            return Ok(Momenta::new(found.momenta, found.report));
        }
        self.reduced.evaluate(poses, basis)
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        self.reduced.film_momenta(poses, twists)
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    /// On the CPU.
    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        self.reduced.surface_potentials(motion, surfaces)
    }

    /// On the CPU.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        self.reduced.surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for Seats {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        if let Some(seat) = self.own()
            && let Some((held, found)) = seat.solve(Kind::Basis, poses, basis)?
        {
            let solved = SolvedTogether::new(seat, poses, basis, held, found);
            return Ok(Box::new(solved));
        }
        self.reduced.linearise(poses, basis)
    }
}
