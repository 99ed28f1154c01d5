//! A seat as a coupling.

use super::question::Kind;
use super::seat::Seat;
use super::solved::SolvedTogether;
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::boundary::PanelBoundary;
use crate::coupling::{
    Coupling, Linearise, Linearised, Momenta, Motion, MotionBar, SurfacePotential,
};
use nalgebra::DMatrix;
use std::sync::Arc;

impl Coupling for Seat {
    fn name(&self) -> &'static str {
        "the fidelity reduced on the GPU, of many scenes together"
    }

    fn bodies(&self) -> usize {
        self.group.model.sizes.bodies
    }

    fn unknowns(&self) -> usize {
        self.group.model.sizes.modes
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        match self.solve(Kind::Value, poses, basis)? {
            Some((_, found)) => Ok(Momenta::new(found.momenta, found.report)),
            None => self.group.model.reduced.evaluate(poses, basis),
        }
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        self.group.model.reduced.film_momenta(poses, twists)
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
        self.group
            .model
            .reduced
            .surface_potentials(motion, surfaces)
    }

    /// On the CPU.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        let reduced = &self.group.model.reduced;
        reduced.surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for Seat {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        match self.solve(Kind::Basis, poses, basis)? {
            Some((held, found)) => Ok(Box::new(SolvedTogether::new(
                self, poses, basis, held, found,
            ))),
            None => self.group.model.reduced.linearise(poses, basis),
        }
    }
}
