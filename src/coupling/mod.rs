//! The fluid's kinetic energy over all bodies, as a function of their poses, with its derivatives.
//!
//! Everything is at unit density and in body-frame twists: for bodies with body-frame twists
//! x̄, ȳ (6 a body, about the body's origin; m/s and rad/s),
//!
//! ```text
//! E(g; x̄, ȳ) = x̄ᵀ M̄_f(g) ȳ          M̄_f symmetric, m³ / m⁴ / m⁵
//! ```
//!
//! and only the bodies' relative placement (and that to the walls) enters g. Displacements of the
//! poses are spatial twists Z (about the world origin), derivatives with respect to them spatial
//! wrenches. Velocities come as combinations of a few *basis* columns, so that a solve is
//! made once per column and every other quantity is a combination.
//!
//! The ladder of E: value [`Coupling::evaluate`], vjp [`Linearised::gradient`] (on the basis) and
//! [`Linearised::vjp`] (any pair), jvp and hvp together in [`Linearised::hvp`]. A fidelity that has values alone is
//! a [`Coupling`]; one that has derivatives too is also [`Linearise`].

mod exclude;
mod fade;
pub(crate) mod film;
pub mod full;
mod given;
mod isolated;
pub mod lubrication;
mod pair;
pub mod panel;
pub mod reduced;
mod response;
pub mod scattering;
pub(crate) mod settings;
mod shape;
mod surface;
mod surface_back;
mod tensor;
mod together;

pub use exclude::Exclusions;
pub use given::Given;
pub use isolated::Isolated;
pub use panel::{ExtrapolatedPanels, FilmedPanels, PanelCoupled, PanelModel};
pub use response::{CoupledResponse, Reached};
pub use shape::{ShapeDirection, ShapeTerm};
pub use surface::{FilmLoad, Motion, MotionBar, SurfacePotential};
pub use tensor::PairTensor;
pub use together::{SceneSize, Together, TogetherReport};

use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6};
use crate::boundary::PanelBoundary;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::sync::Arc;

/// A fidelity: a way to get M̄_f from the bodies' poses.
pub trait Coupling: Send + Sync {
    /// What it is, for messages: "the …".
    fn name(&self) -> &'static str;

    /// Number of bodies in the water.
    fn bodies(&self) -> usize;

    /// Number of unknowns of one solve.
    fn unknowns(&self) -> usize;

    /// M̄_f applied to the columns of `basis` (6·bodies × k, body-frame twists) at the given poses.
    ///
    /// # Errors
    /// [`Error::Input`] for other numbers of poses and rows than the bodies have; a solve that misses its tolerance, bodies that overlap, or a gap that isn't resolved.
    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta>;

    /// The same fidelity with its derivatives, if it has any.
    fn differentiable(&self) -> Option<&dyn Linearise> {
        None
    }

    /// The added mass of each body at unit density (body frame, about its origin) where none feels another: M̄_f is block diagonal and no pose changes it, so that
    /// nobody need ask for its products with a basis. `None` where bodies feel each other or a wall.
    fn apart(&self) -> Option<&[Mat6]> {
        None
    }

    /// The coupling of so many bodies that no matrix of them is formed, of which answers to single directions are asked; `None` of others.
    fn scattering(&self) -> Option<&scattering::Scattering> {
        None
    }

    /// Seats for up to `scenes` equal scenes that are simulated side by side, whose basis has `columns` columns; `None` of a fidelity, or of scenes, that gain
    /// nothing by it.
    ///
    /// # Errors
    /// A device that fails.
    fn together(&self, _scenes: usize, _columns: usize) -> Result<Option<Arc<dyn Together>>> {
        Ok(None)
    }

    /// Number of shape parameters that it was made with ([`ShapeDirection`]): their order is that of what [`Linearised::shape_vjp`] tells.
    fn shape_parameters(&self) -> usize {
        0
    }

    /// Takes for each body what its added mass is given to have more than it has alone in the water (as [`Given::new`]), where it can by itself; false of a coupling that [`Given`] is to carry.
    fn give(&mut self, _change: &[Mat6]) -> bool {
        false
    }

    /// What normal velocities left between the collocation points are worth: the change of
    /// `basisᵀ M̄_f basis` that they ask for, symmetric. `None` where there are no such points.
    ///
    /// # Errors
    /// As [`Coupling::evaluate`].
    fn residual(&self, _poses: &[Pose], _basis: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        Ok(None)
    }

    /// What films in narrow gaps add to the impulses of body-frame twists, 6·bodies × columns, at density 1. `None` where there are no films whatever
    /// the gaps.
    ///
    /// # Errors
    /// Bodies that touch.
    fn film_momenta(
        &self,
        _poses: &[Pose],
        _twists: &DMatrix<f64>,
    ) -> Result<Option<DMatrix<f64>>> {
        Ok(None)
    }

    /// The water's velocity at points (m, world frame) that lie outside all bodies, per body-frame twists of the bodies
    /// (6·bodies) in water at rest: m/s, world axes. `None` of a fidelity that has no flow of its own up to the surfaces; that follows from
    /// [`Coupling::surface_potentials`].
    ///
    /// # Errors
    /// As [`Coupling::evaluate`].
    fn velocity(
        &self,
        _poses: &[Pose],
        _twists: &DVector<f64>,
        _points: &[Vec3],
    ) -> Result<Option<Vec<Vec3>>> {
        Ok(None)
    }

    /// The panels of each body, of a fidelity that is made of them.
    fn surfaces(&self) -> Option<&[Arc<PanelBoundary>]> {
        None
    }

    /// The flow's potential on all panels, and its rate. `surfaces` are [`Coupling::surfaces`], or panels of any mesh of each body where there are none.
    ///
    /// # Errors
    /// As [`Coupling::evaluate`], and a device that doesn't tell the rates of its densities.
    fn surface_potentials(
        &self,
        _motion: &Motion,
        _surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        Err(Error::Unsupported {
            what: format!("the flow on surfaces with {}", self.name()),
            why: "it tells impulses alone".into(),
            instead: "use the fidelity reduced or full".into(),
        })
    }

    /// The transpose of [`Coupling::surface_potentials`] at this motion: the gradient of Σ `bars` · potentials, values and rates.
    ///
    /// # Errors
    /// As there; cotangents of other numbers of faces.
    fn surface_potentials_vjp(
        &self,
        _motion: &Motion,
        _surfaces: &[Arc<PanelBoundary>],
        _bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        Err(Error::Unsupported {
            what: format!("the derivative of the flow with {}", self.name()),
            why: "it tells impulses alone".into(),
            instead: "use the fidelity reduced or full, on the CPU".into(),
        })
    }
}

/// A fidelity with derivatives of M̄_f with respect to the poses.
pub trait Linearise: Coupling {
    /// As [`Coupling::evaluate`], with what the derivatives there need.
    ///
    /// # Errors
    /// As there.
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>>;
}

/// M̄_f applied to columns of body-frame twists.
#[derive(Clone, Debug)]
pub struct Momenta {
    momenta: DMatrix<f64>,
    report: CouplingReport,
}

impl Momenta {
    /// Impulses with what they cost.
    pub fn new(momenta: DMatrix<f64>, report: CouplingReport) -> Self {
        Self { momenta, report }
    }

    /// M̄_f times the basis: body-frame impulses, 6·bodies × k.
    pub fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    /// What it cost.
    pub fn report(&self) -> &CouplingReport {
        &self.report
    }
}

/// What one evaluation cost and how far to trust it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CouplingReport {
    /// Iterations of the slowest column; 0 for direct solves.
    pub iterations: usize,
    /// Largest relative residual of the normal equations reached.
    pub residual: f64,
    /// max |M_ij − M_ji| / √(M_ii M_jj) over the basis, before symmetrising.
    pub asymmetry: f64,
    /// Condition number of the dense system (estimated from below); 0 for iterative solves.
    pub condition: f64,
}

/// A combination of bodies' twists.
#[derive(Clone, Copy, Debug)]
pub enum Direction<'a> {
    /// Coefficients on the basis columns (k).
    Basis(&'a DVector<f64>),
    /// Body-frame twists themselves (6·bodies).
    Twist(&'a DVector<f64>),
}

impl Direction<'_> {
    /// Both directions, or the one that they are.
    pub fn distinct(x: Self, y: Self) -> Vec<Self> {
        let same = match (&x, &y) {
            (Self::Basis(a), Self::Basis(b)) | (Self::Twist(a), Self::Twist(b)) => a == b,
            _ => false,
        };
        if same { vec![x] } else { vec![x, y] }
    }
}

/// First derivatives for a pair of directions.
#[derive(Clone, Debug)]
pub struct Pullback {
    /// M̄_f x̄, body-frame impulses (6·bodies): ∂E/∂ȳ.
    pub momentum_x: DVector<f64>,
    /// M̄_f ȳ: ∂E/∂x̄.
    pub momentum_y: DVector<f64>,
    /// ∇_g E(x̄, ȳ): a spatial wrench on each body.
    pub wrench: Vec<Vec6>,
}

/// Second derivatives along one displacement.
#[derive(Clone, Debug)]
pub struct Tangent {
    /// `D_g M̄_f[Z] x̄`, body-frame impulses (6·bodies).
    pub momentum_x: DVector<f64>,
    /// `D_g M̄_f[Z] ȳ`.
    pub momentum_y: DVector<f64>,
    /// The spatial wrenches ∇_g E(x̄, ȳ) themselves, as [`Linearised::vjp`] gives them.
    pub gradient: Vec<Vec6>,
    /// Rate of the spatial wrenches ∇_g E(x̄, ȳ) as the bodies are displaced by exp(εZ), at fixed
    /// body-frame twists. For another displacement Y, D_Y(∇E·Z) = wrench·Y + ∇E·(Z × Y).
    pub wrench: Vec<Vec6>,
}

/// What twists w beside x̄ and a displacement Z of the bodies add up to.
#[derive(Clone, Debug)]
pub struct Carried {
    /// M̄_f w + `D_g M̄_f[Z] x̄`, body-frame impulses (6·bodies).
    pub momentum: DVector<f64>,
    /// ∇_g E(w, x̄), and half the rate of ∇_g E(x̄, x̄) along Z: spatial wrenches.
    pub wrench: Vec<Vec6>,
    /// ∇_g E(x̄, x̄).
    pub gradient: Vec<Vec6>,
}

/// One evaluation at given poses with the key to the derivatives there.
pub trait Linearised: Send + Sync {
    /// M̄_f times the basis: body-frame impulses, 6·bodies × k; 0 × 0 where a coupling that forms no matrix was placed without a basis.
    fn momenta(&self) -> &DMatrix<f64>;

    /// ∇_g E(x, y) for coefficients on the basis, without a further solve: a spatial wrench on each
    /// body.
    ///
    /// # Errors
    /// A device that fails.
    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>>;

    /// ∇_g E(x, e_i) for every basis column e_i, as [`Linearised::gradient`].
    ///
    /// # Errors
    /// As there.
    fn gradient_columns(&self, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        let unit = |i: usize| DVector::from_fn(x.len(), |k, _| f64::from(k == i));
        (0..x.len()).map(|i| self.gradient(x, &unit(i))).collect()
    }

    /// `D_g E(e_i, y)[Z]` for every basis column e_i, without a further solve.
    ///
    /// # Errors
    /// As [`Linearised::gradient`].
    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>>;

    /// Impulses of both directions and ∇_g E(x̄, ȳ), for any directions.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback>;

    /// M̄_f times further columns of body-frame twists (6·bodies × K), and ∇_g E of each with x, coefficients on the basis: [`Linearised::vjp`] of
    /// every column.
    ///
    /// # Errors
    /// As there.
    fn respond(
        &self,
        twists: &DMatrix<f64>,
        x: &DVector<f64>,
    ) -> Result<(DMatrix<f64>, Vec<Vec<Vec6>>)> {
        let mut momenta = DMatrix::zeros(twists.nrows(), twists.ncols());
        let mut wrenches = vec![vec![Vec6::zeros(); twists.nrows() / 6]; twists.ncols()];
        for (k, wrenches) in wrenches.iter_mut().enumerate() {
            let twist = twists.column(k).into_owned();
            if twist.iter().any(|x| *x != 0.0) {
                let pullback = self.vjp(Direction::Twist(&twist), Direction::Basis(x))?;
                momenta.set_column(k, &pullback.momentum_x);
                *wrenches = pullback.wrench;
            }
        }
        Ok((momenta, wrenches))
    }

    /// Of x, coefficients on the basis, what further twists (6·bodies) and a displacement add up to, where that takes fewer solves than each for itself.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    fn carried(
        &self,
        _x: &DVector<f64>,
        _twists: &DVector<f64>,
        _z: &[Vec6],
    ) -> Result<Option<Carried>> {
        Ok(None)
    }

    /// [`Linearised::hvp`] of x, coefficients on the basis, with itself along each displacement.
    ///
    /// # Errors
    /// As there.
    fn displaced(&self, x: &DVector<f64>, z: &[Vec<Vec6>]) -> Result<Vec<Tangent>> {
        let through = Direction::Basis(x);
        z.iter().map(|z| self.hvp(through, through, z)).collect()
    }

    /// The tangent along the displacement Z (one spatial twist a body).
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent>;

    /// Derivative of the sum of `terms` with respect to each shape parameter that the coupling was made with, at constant poses and body-frame twists: exactly that
    /// of the discrete sums.
    ///
    /// # Errors
    /// A solve that misses its tolerance; a coupling that has shape parameters, but not of what acts at these poses (films).
    fn shape_vjp(&self, _terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        Ok(DVector::zeros(0))
    }

    /// What it cost.
    fn report(&self) -> &CouplingReport;
}
