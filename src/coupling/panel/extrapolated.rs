//! Coupled panels on two meshes of each body, extrapolated.
//!
//! The energy of faces with edges h is off by about h². From fine and coarse meshes, ρ = `h_coarse`/`h_fine`,
//!
//! ```text
//! E = E_fine + (E_fine − E_coarse)/(ρ² − 1)
//! ```
//!
//! takes that part away: between round bodies it is nearly all, in a film between flat faces, whose rim is of first order, about half. As
//! E is linear in both, so are all its derivatives. With a quarter of the faces the coarse system costs a sixteenth of the fine one.

use super::PanelCoupled;
use super::filmed::{FilmedPanels, HeldApart};
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::boundary::PanelBoundary;
use crate::coupling::film::PlacedFilms;
use crate::coupling::{
    Coupling, CouplingReport, Direction, Linearise, Linearised, Momenta, Motion, MotionBar,
    Pullback, ShapeDirection, ShapeTerm, SurfacePotential, Tangent,
};
use crate::geometry::{Solid, TriMesh, Wall};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Least ratio of edge lengths from which two meshes say something.
const RATIO: f64 = 1.2;

/// Coupled panels on two meshes, extrapolated.
pub struct ExtrapolatedPanels {
    fine: PanelCoupled,
    coarse: PanelCoupled,
    /// F = 1/(ρ² − 1).
    factor: f64,
    /// Its change with each shape parameter.
    factor_rates: Vec<f64>,
}

impl ExtrapolatedPanels {
    /// From the same bodies by fine and by coarse panels, whose edges are `ratio` times as long. Where bodies have different ratios the largest
    /// is the safe one; one that has a single mesh stands in both.
    ///
    /// # Errors
    /// Different numbers of bodies, or a ratio under 1.2.
    pub fn new(fine: PanelCoupled, coarse: PanelCoupled, ratio: f64) -> Result<Self> {
        let input = |field: &str, value: String, expected: String| {
            Err(Error::input(
                format!("extrapolated panels: {field}"),
                value,
                expected,
            ))
        };
        let (found, expected) = (coarse.bodies(), fine.bodies());
        if found != expected {
            let expected = format!("{expected}, as the fine ones");
            return input("bodies by coarse panels", found.to_string(), expected);
        }
        if !(RATIO..=1e3).contains(&ratio) {
            let expected = format!("a number from {RATIO} on: the coarse meshes need fewer faces");
            return input("ratio of the edges", ratio.to_string(), expected);
        }
        Ok(Self {
            fine,
            coarse,
            factor: 1.0 / (ratio * ratio - 1.0),
            factor_rates: Vec::new(),
        })
    }

    /// As [`PanelCoupled::with_films`]: both meshes are held apart alike, by what the fine one doesn't resolve.
    ///
    /// # Errors
    /// As there.
    pub fn with_films(
        self,
        surfaces: &[(&TriMesh, Option<&Solid>)],
        walls: &[Wall],
    ) -> Result<FilmedPanels> {
        FilmedPanels::new(Box::new(self), surfaces, walls)
    }

    /// With the shape parameters of the bodies: how the vertices of the fine and of the coarse meshes move with each, and how the ratio of the edges changes, per unit of
    /// it; after the added masses that are known. In the water [`Linearised::shape_vjp`] then tells the derivatives of what is extrapolated.
    ///
    /// # Errors
    /// As [`PanelCoupled::with_shapes`], and lists of different lengths.
    pub fn with_shapes(
        self,
        fine: Vec<ShapeDirection>,
        coarse: Vec<ShapeDirection>,
        ratio_rates: Vec<f64>,
    ) -> Result<Self> {
        let (expected, found) = (fine.len(), [coarse.len(), ratio_rates.len()]);
        if found != [expected; 2] {
            return Err(Error::input(
                "extrapolated panels: shape parameters of the coarse meshes, and rates of the ratio",
                format!("{found:?}"),
                format!("{expected} each, as of the fine meshes"),
            ));
        }
        // ∂F/∂ρ = −2 ρ F²
        let ratio = (1.0 + 1.0 / self.factor).sqrt();
        let slope = -2.0 * ratio * self.factor * self.factor;
        Ok(Self {
            fine: self.fine.with_shapes(fine)?,
            coarse: self.coarse.with_shapes(coarse)?,
            factor_rates: ratio_rates.iter().map(|r| slope * r).collect(),
            ..self
        })
    }

    fn report(&self, fine: &CouplingReport, coarse: &CouplingReport) -> CouplingReport {
        CouplingReport {
            iterations: fine.iterations.max(coarse.iterations),
            residual: fine.residual.max(coarse.residual),
            ..fine.clone()
        }
    }
}

/// The sum of the terms themselves.
fn summed(
    linearised: &dyn Linearised,
    terms: &[ShapeTerm],
    twists: impl Fn(Direction) -> DVector<f64>,
) -> Result<f64> {
    let mut sum = 0.0;
    for term in terms {
        let found = linearised.vjp(term.x, term.y)?;
        let value: f64 = match term.along {
            Some(z) => found.wrench.iter().zip(z).map(|(w, z)| w.dot(z)).sum(),
            None => found.momentum_x.dot(&twists(term.y)),
        };
        sum += term.weight * value;
    }
    Ok(sum)
}

/// `fine + factor (fine − coarse)`.
fn vector(factor: f64, mut fine: DVector<f64>, coarse: &DVector<f64>) -> DVector<f64> {
    fine *= 1.0 + factor;
    fine.axpy(-factor, coarse, 1.0);
    fine
}

fn matrix(factor: f64, fine: &DMatrix<f64>, coarse: &DMatrix<f64>) -> DMatrix<f64> {
    fine.zip_map(coarse, |f, c| f + factor * (f - c))
}

fn wrenches(factor: f64, fine: Vec<Vec6>, coarse: &[Vec6]) -> Vec<Vec6> {
    let pairs = fine.into_iter().zip(coarse);
    pairs.map(|(f, c)| f + factor * (f - c)).collect()
}

impl Coupling for ExtrapolatedPanels {
    fn name(&self) -> &'static str {
        self.fine.name()
    }

    fn bodies(&self) -> usize {
        self.fine.bodies()
    }

    fn unknowns(&self) -> usize {
        self.fine.unknowns()
    }

    fn shape_parameters(&self) -> usize {
        self.fine.shape_parameters()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        self.evaluate_held(poses, basis, &Arc::default())
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    /// Extrapolated as well: the coarse faces of a round body lie inside the fine ones.
    fn velocity(
        &self,
        poses: &[Pose],
        twists: &DVector<f64>,
        points: &[Vec3],
    ) -> Result<Option<Vec<Vec3>>> {
        let fine = self.fine.velocity(poses, twists, points)?;
        let coarse = self.coarse.velocity(poses, twists, points)?;
        let both = fine.zip(coarse);
        Ok(both.map(|(fine, coarse)| {
            let pairs = fine.iter().zip(&coarse);
            pairs.map(|(f, c)| f + self.factor * (f - c)).collect()
        }))
    }

    fn surfaces(&self) -> Option<&[Arc<PanelBoundary>]> {
        self.fine.surfaces()
    }

    /// Of the fine faces: coarse ones are elsewhere.
    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        self.fine.surface_potentials(motion, surfaces)
    }

    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        self.fine.surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for ExtrapolatedPanels {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        self.linearise_held(poses, basis, &Arc::default())
    }
}

impl HeldApart for ExtrapolatedPanels {
    fn panels(&self) -> &PanelCoupled {
        &self.fine
    }

    fn rename(&mut self, names: &[String]) {
        self.fine.rename(names);
        self.coarse.rename(names);
    }

    fn evaluate_held(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Momenta> {
        let fine = self.fine.evaluate_held(poses, basis, films)?;
        let coarse = self.coarse.evaluate_held(poses, basis, films)?;
        Ok(Momenta::new(
            matrix(self.factor, fine.momenta(), coarse.momenta()),
            self.report(fine.report(), coarse.report()),
        ))
    }

    fn linearise_held<'a>(
        &'a self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Box<dyn Linearised + 'a>> {
        let fine = self.fine.linearise_held(poses, basis, films)?;
        let coarse = self.coarse.linearise_held(poses, basis, films)?;
        Ok(Box::new(ExtrapolatedLinearised {
            factor: self.factor,
            factor_rates: &self.factor_rates,
            basis: basis.clone(),
            momenta: matrix(self.factor, fine.momenta(), coarse.momenta()),
            report: self.report(fine.report(), coarse.report()),
            fine,
            coarse,
        }))
    }

    fn surface_potentials_held(
        &self,
        motion: &Motion,
        films: &Arc<PlacedFilms>,
    ) -> Result<Vec<SurfacePotential>> {
        self.fine.surface_potentials_held(motion, films)
    }
}

/// [`ExtrapolatedPanels`] at given poses.
struct ExtrapolatedLinearised<'a> {
    fine: Box<dyn Linearised + 'a>,
    coarse: Box<dyn Linearised + 'a>,
    factor: f64,
    factor_rates: &'a [f64],
    basis: DMatrix<f64>,
    momenta: DMatrix<f64>,
    report: CouplingReport,
}

impl Linearised for ExtrapolatedLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let fine = self.fine.gradient(x, y)?;
        Ok(wrenches(self.factor, fine, &self.coarse.gradient(x, y)?))
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        let fine = self.fine.gradient_along(y, z)?;
        Ok(vector(
            self.factor,
            fine,
            &self.coarse.gradient_along(y, z)?,
        ))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let (fine, coarse) = (self.fine.vjp(x, y)?, self.coarse.vjp(x, y)?);
        Ok(Pullback {
            momentum_x: vector(self.factor, fine.momentum_x, &coarse.momentum_x),
            momentum_y: vector(self.factor, fine.momentum_y, &coarse.momentum_y),
            wrench: wrenches(self.factor, fine.wrench, &coarse.wrench),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let (fine, coarse) = (self.fine.hvp(x, y, z)?, self.coarse.hvp(x, y, z)?);
        Ok(Tangent {
            momentum_x: vector(self.factor, fine.momentum_x, &coarse.momentum_x),
            momentum_y: vector(self.factor, fine.momentum_y, &coarse.momentum_y),
            gradient: wrenches(self.factor, fine.gradient, &coarse.gradient),
            wrench: wrenches(self.factor, fine.wrench, &coarse.wrench),
        })
    }

    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        let (fine, coarse) = (self.fine.shape_vjp(terms)?, self.coarse.shape_vjp(terms)?);
        let mut out = vector(self.factor, fine, &coarse);
        if self.factor_rates.iter().any(|rate| *rate != 0.0) {
            let twists = |x: Direction| match x {
                Direction::Basis(c) => &self.basis * c,
                Direction::Twist(x) => x.clone(),
            };
            let step = summed(&*self.fine, terms, twists)? - summed(&*self.coarse, terms, twists)?;
            let rates = out.iter_mut().zip(self.factor_rates);
            rates.for_each(|(o, rate)| *o += step * rate);
        }
        Ok(out)
    }

    fn report(&self) -> &CouplingReport {
        &self.report
    }
}
