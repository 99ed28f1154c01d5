//! Bodies that don't feel each other: each keeps its own constant added mass (Eq. 12).

use super::settings::check_asked;
use super::surface::{check, on_surfaces};
use super::surface_back::{Back, onto_charges};
use super::{
    Coupling, CouplingReport, Direction, Linearise, Linearised, Momenta, Motion, MotionBar,
    Pullback, ShapeTerm, SurfacePotential, Tangent,
};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use crate::boundary::PanelBoundary;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The cheapest fidelity: no interaction, no walls.
#[derive(Clone, Debug)]
pub struct Isolated {
    added_mass: Vec<Mat6>,
    /// A body with the derivative of its added mass, one a shape parameter.
    shapes: Vec<(usize, Mat6)>,
}

impl Isolated {
    /// From each body's own added mass at unit density, body frame, about the body's origin.
    pub fn new(added_mass: Vec<Mat6>) -> Self {
        Self {
            added_mass,
            shapes: Vec::new(),
        }
    }

    /// The same with shape parameters: each a body, by its number in the water, and the derivative of its added mass (unit density, body frame, about its origin).
    ///
    /// # Errors
    /// [`Error::Input`] for a body that isn't there.
    pub fn with_shapes(mut self, shapes: Vec<(usize, Mat6)>) -> Result<Self> {
        let bodies = self.added_mass.len();
        if let Some((b, _)) = shapes.iter().find(|(b, _)| *b >= bodies) {
            let right = format!("must be below the number of bodies, {bodies}");
            return Err(Error::input("shape parameter: body", b, right));
        }
        self.shapes = shapes;
        Ok(self)
    }

    /// The added mass of each body, at unit density (body frame, about its origin).
    pub fn added_masses(&self) -> &[Mat6] {
        &self.added_mass
    }

    /// Impulses of columns of twists.
    fn impulses(&self, twists: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(twists.nrows(), twists.ncols());
        for (b, m) in self.added_mass.iter().enumerate() {
            out.rows_mut(6 * b, 6)
                .copy_from(&(m * twists.rows(6 * b, 6)));
        }
        out
    }
}

impl Coupling for Isolated {
    fn name(&self) -> &'static str {
        "the fidelity isolated"
    }

    fn bodies(&self) -> usize {
        self.added_mass.len()
    }

    fn unknowns(&self) -> usize {
        0
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        check_asked(self, poses, basis)?;
        Ok(Momenta::new(
            self.impulses(basis),
            CouplingReport::default(),
        ))
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    fn apart(&self) -> Option<&[Mat6]> {
        Some(&self.added_mass)
    }

    fn shape_parameters(&self) -> usize {
        self.shapes.len()
    }

    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        check(motion, surfaces)?;
        Ok(on_surfaces(motion, surfaces, &[], |_| Vec::new(), None))
    }

    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        check(motion, surfaces)?;
        let Back { bar, .. } = onto_charges(surfaces, bars)?;
        Ok(bar)
    }
}

impl Linearise for Isolated {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        Ok(Box::new(IsolatedLinearised {
            coupling: self,
            value: self.evaluate(poses, basis)?,
            basis: basis.clone(),
        }))
    }
}

struct IsolatedLinearised<'a> {
    coupling: &'a Isolated,
    value: Momenta,
    basis: DMatrix<f64>,
}

impl IsolatedLinearised<'_> {
    fn impulse(&self, x: Direction) -> DVector<f64> {
        match x {
            Direction::Basis(c) => self.value.momenta() * c,
            Direction::Twist(x) => {
                let twists = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
                self.coupling.impulses(&twists).column(0).into_owned()
            }
        }
    }
}

impl Linearised for IsolatedLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        self.value.momenta()
    }

    fn gradient(&self, _x: &DVector<f64>, _y: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(vec![Vec6::zeros(); self.coupling.bodies()])
    }

    fn gradient_along(&self, y: &DVector<f64>, _z: &[Vec6]) -> Result<DVector<f64>> {
        Ok(DVector::zeros(y.len()))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        Ok(Pullback {
            momentum_x: self.impulse(x),
            momentum_y: self.impulse(y),
            wrench: vec![Vec6::zeros(); self.coupling.bodies()],
        })
    }

    fn respond(
        &self,
        twists: &DMatrix<f64>,
        _x: &DVector<f64>,
    ) -> Result<(DMatrix<f64>, Vec<Vec<Vec6>>)> {
        let still = vec![vec![Vec6::zeros(); self.coupling.bodies()]; twists.ncols()];
        Ok((self.coupling.impulses(twists), still))
    }

    fn hvp(&self, _x: Direction, _y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let zero = DVector::zeros(6 * self.coupling.bodies());
        Ok(Tangent {
            momentum_x: zero.clone(),
            momentum_y: zero,
            gradient: vec![Vec6::zeros(); z.len()],
            wrench: vec![Vec6::zeros(); z.len()],
        })
    }

    /// Σ weight x̄ᵀ dM̄ ȳ; no pose changes it, so that slopes have none.
    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        let twists = |x: Direction| match x {
            Direction::Basis(c) => &self.basis * c,
            Direction::Twist(x) => x.clone(),
        };
        let still = terms.iter().filter(|t| t.along.is_none());
        let pairs: Vec<_> = still
            .map(|t| (t.weight, twists(t.x), twists(t.y)))
            .collect();
        let of = |(b, slope): &(usize, Mat6)| {
            let each = pairs.iter().map(|(weight, x, y)| {
                let (x, y) = (x.fixed_rows::<6>(6 * b), y.fixed_rows::<6>(6 * b));
                weight * x.dot(&(slope * y))
            });
            each.sum::<f64>()
        };
        Ok(DVector::from_iterator(
            self.coupling.shapes.len(),
            self.coupling.shapes.iter().map(of),
        ))
    }

    fn report(&self) -> &CouplingReport {
        self.value.report()
    }
}
