//! One evaluation of the coupled system, and its derivatives: what a backend's solution means.

use super::{Full, Model, SystemResponse};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::settings::asymmetry;
use crate::coupling::{
    CouplingReport, Direction, Linearised, Momenta, PairTensor, Pullback, Tangent,
};
use nalgebra::{DMatrix, DVector};

/// [`Full`] solved for a basis.
pub(super) struct Solved<'a> {
    pub model: &'a Model,
    /// Solution to the basis.
    pub response: Box<dyn SystemResponse + 'a>,
    pub value: Momenta,
}

/// [`Full`] with its derivatives.
pub(super) struct FullLinearised<'a> {
    pub solved: Solved<'a>,
    pub gradient: PairTensor,
}

impl<'a> Solved<'a> {
    pub fn new(full: &'a Full, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        let model = full.model();
        let response = full.backend().respond(poses, basis)?;
        let volume = |b: usize| model.bodies[b].faces.volume();
        let reached = response.reached();
        let report = CouplingReport {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: asymmetry(&response.energies()?, basis, volume),
            condition: 0.0,
        };
        Ok(Self {
            value: Momenta::new(response.momenta()?, report),
            model,
            response,
        })
    }
}

impl Linearised for FullLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        self.solved.value.momenta()
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(self.gradient.contract(x, y))
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        Ok(self.gradient.along(y, z))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let directions = Direction::distinct(x, y);
        let n = directions.len();
        let response = self.solved.response.directions(&directions)?;
        let momenta = response.momenta()?;
        let unit = |i: usize| DVector::from_fn(n, |k, _| f64::from(k == i));
        Ok(Pullback {
            momentum_x: momenta.column(0).into_owned(),
            momentum_y: momenta.column(n - 1).into_owned(),
            wrench: response.gradient()?.contract(&unit(0), &unit(n - 1)),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        self.solved
            .response
            .directions(&Direction::distinct(x, y))?
            .tangent(z)
    }

    fn report(&self) -> &CouplingReport {
        self.solved.value.report()
    }
}
