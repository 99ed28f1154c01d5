//! All bodies in one panel system, with all derivatives.
//!
//! The unknowns are the potentials of all panels ([`crate::boundary::panel`]). Walls mirror the flow,
//! so an image body has the potentials and normal velocities of the body itself (of opposite
//! sign in a free surface), and its layers at x are those of the body at the mirrored point. Over the bodies'
//! images, s their signs, with q = F x̄ the normal velocities and D the panels' areas,
//!
//! ```text
//! A φ = S q,   A = ½ I + Σ_images s Ω/4π,   S = Σ_images s S_image
//! E(x, y) = sym( (D F x)ᵀ A⁻¹ S F y )
//! M̄ x̄ = ½ { Fᵀ D φ + Fᵀ Sᵀ μ },   Aᵀ μ = D F x̄
//! δE(x, y) = ½ [ μ_xᵀ (δS q_y − δA φ_y) + μ_yᵀ (δS q_x − δA φ_x) ]
//! ```
//!
//! Where a body's added mass in unbounded fluid is known better than its own panels tell it (by formula, or extrapolated from two
//! meshes), the difference is added to its block of M̄ ([`PanelCoupled::with_added_mass`]): in the body's frame it is constant,
//! so no derivative changes, and what is left is the error of the coupling alone.
//!
//! E is symmetrised, and its derivatives are exactly those of the symmetrised E. They cost no further solve on the basis; the tangent
//! takes two, `A δφ = δS q − δA φ` and `Aᵀ δμ = −δAᵀ μ`. A body's own block of A doesn't change with the poses: its inverse, made
//! once, and the blocks by which bodies act on later ones precondition the iteration (block Gauss–Seidel). All other entries depend on the position of a panel's centroid in the frame of another
//! body alone; seen from afar they are multipoles ([`double`](mod@crate::adjoint::kernel::double)). Bodies and images that come closer than about half an edge length lose accuracy,
//! but for what films in such gaps carry ([`PanelCoupled::with_films`]).

mod extrapolated;
mod filmed;
mod first;
mod model;
mod placed;
mod second;
mod shape;
mod surface;
mod sweep;
mod system;

pub use extrapolated::ExtrapolatedPanels;
pub use filmed::FilmedPanels;
pub use model::PanelModel;

use super::film::PlacedFilms;
use super::full::{SolveSettings, SystemBackend};
use super::response::{CoupledResponse, Solved};
use super::settings::check_asked;
use super::surface::{check, check_bars};
use super::{
    Coupling, Exclusions, Linearise, Linearised, Momenta, Motion, MotionBar, ShapeDirection,
    SurfacePotential,
};
use crate::adjoint::lie::{Mat6, Pose, Vec3};
use crate::boundary::PanelBoundary;
use crate::geometry::{Solid, TriMesh, Wall};
use crate::{Error, Result};
use filmed::HeldApart;
use nalgebra::{DMatrix, DVector};
use placed::{PanelSolution, PlacedPanels};
use std::sync::Arc;

/// All bodies coupled through one panel system, and plane walls by images.
pub struct PanelCoupled {
    model: Arc<PanelModel>,
    /// What computes impulses and their derivatives, if not the CPU.
    backend: Option<Box<dyn SystemBackend>>,
}

impl PanelCoupled {
    /// On the CPU, from the bodies, the walls (one, or mutually perpendicular ones), the pairs of bodies that don't feel
    /// each other, and the solver's settings. [`FullSolver::Qr`](super::full::FullSolver::Qr) factors the whole matrix by LU (8·faces²
    /// bytes, and faces³ operations); the others stand for GMRES, preconditioned by each body's own inverse,
    /// which stores the blocks between different bodies and those with images.
    ///
    /// # Errors
    /// Walls that don't close under reflection, pairs of bodies that don't exist, settings out of range, and
    /// more than [`MOST_FACES`](crate::boundary::panel::MOST_FACES) faces in all.
    pub fn new(
        bodies: Vec<Arc<PanelBoundary>>,
        walls: &[Wall],
        excluded: Exclusions,
        settings: SolveSettings,
    ) -> Result<Self> {
        Ok(Self {
            model: Arc::new(PanelModel::new(bodies, walls, excluded, settings)?),
            backend: None,
        })
    }

    /// With the added mass of each body in unbounded fluid (about the body's origin, density 1), where it is known better than its
    /// panels tell it. Before [`PanelCoupled::on`]: a backend doesn't learn of it afterwards.
    pub fn with_added_mass(mut self, known: &[Option<Mat6>]) -> Self {
        Arc::make_mut(&mut self.model).know(known);
        self
    }

    /// With the shape parameters of the bodies, of which [`Linearised::shape_vjp`] then tells the derivatives; after
    /// [`PanelCoupled::with_added_mass`]. Not on a backend.
    ///
    /// # Errors
    /// [`Error::Input`] for a body that doesn't exist, velocities that aren't one for each vertex, and a body whose added mass is known, but not how it changes.
    pub fn with_shapes(mut self, shapes: Vec<ShapeDirection>) -> Result<Self> {
        Arc::make_mut(&mut self.model).change(shapes)?;
        Ok(self)
    }

    /// The same with names of the bodies, for messages; those beyond the bodies are dropped. Before [`PanelCoupled::on`]: a backend has those of its model.
    pub fn named(mut self, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().take(self.bodies()).collect();
        self.rename(&names);
        self
    }

    /// On a backend made for the same model; [`Coupling::velocity`] stays on the CPU.
    pub fn on(self, backend: Box<dyn SystemBackend>) -> Self {
        Self {
            backend: Some(backend),
            ..self
        }
    }

    /// With films in the gaps between bodies, and to rigid walls, that panels don't resolve: from the surface of each body in its own frame, and its shape
    /// by formula where it has one.
    ///
    /// # Errors
    /// [`Error::Input`] if there isn't one surface for each body, or for a wall without normal.
    pub fn with_films(
        self,
        surfaces: &[(&TriMesh, Option<&Solid>)],
        walls: &[Wall],
    ) -> Result<FilmedPanels> {
        FilmedPanels::new(Box::new(self), surfaces, walls)
    }

    /// What the system consists of.
    pub fn model(&self) -> &Arc<PanelModel> {
        &self.model
    }

    /// The solution, and the condition number of a dense matrix. Bodies that are held apart are solved on the CPU.
    fn respond<'a>(
        &'a self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<(Box<dyn CoupledResponse + 'a>, f64)> {
        if let Some(backend) = self.backend.as_ref().filter(|_| !films.any()) {
            self.model.check_walls(poses)?;
            return Ok((backend.respond(poses, basis)?, 0.0));
        }
        let placed = Arc::new(PlacedPanels::new(&self.model, poses, films, basis)?);
        let condition = placed.system.condition();
        let solution = PanelSolution::new(placed, basis.clone())?;
        Ok((Box::new(solution), condition))
    }

    fn solved<'a>(
        &'a self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Solved<dyn CoupledResponse + 'a>> {
        let model = self.model();
        check_asked(self, poses, basis)?;
        let (response, condition) = self.respond(poses, basis, films)?;
        let volume = |b: usize| model.bodies[b].faces.volume();
        let solved = Solved::new(response, basis, volume, condition)?;
        if solved.value.momenta().iter().any(|x| !x.is_finite()) {
            return Err(Error::Solver {
                what: format!("the coupled panel system ({} panels)", model.rows()),
                iterations: solved.value.report().iterations,
                residual: f64::NAN,
                tolerance: model.settings.tolerance,
                remedy: "check the poses: the impulses aren't finite".into(),
            });
        }
        Ok(solved)
    }
}

impl Coupling for PanelCoupled {
    fn name(&self) -> &'static str {
        "the coupled panel method"
    }

    fn bodies(&self) -> usize {
        self.model.bodies.len()
    }

    fn unknowns(&self) -> usize {
        self.model.rows()
    }

    fn shape_parameters(&self) -> usize {
        self.model.shapes().len()
    }

    /// # Errors
    /// A solve that misses its tolerance, bodies that overlap or reach through a wall. Overlap is
    /// noticed where a panel's centroid is inside another body.
    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        self.evaluate_held(poses, basis, &Arc::default())
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    /// Sheets of vorticity and sources on all bodies and their images ([`crate::boundary::panel`]). Bodies that don't feel each
    /// other are solved as if the other weren't there; the flow is the sum of theirs.
    fn velocity(
        &self,
        poses: &[Pose],
        twists: &DVector<f64>,
        points: &[Vec3],
    ) -> Result<Option<Vec<Vec3>>> {
        if points.is_empty() {
            return Ok(Some(Vec::new()));
        }
        let model = self.model();
        let column = DMatrix::from_column_slice(twists.len(), 1, twists.as_slice());
        check_asked(self, poses, &column)?;
        let placed = PlacedPanels::new(model, poses, &Arc::default(), &column)?;
        let phi = placed.potentials(&column)?;
        let mut out = vec![Vec3::zeros(); points.len()];
        for (b, body) in model.bodies.iter().enumerate() {
            let resting = || vec![0.0; body.faces.len()];
            let q = placed.normal_velocity(b, &column).unwrap_or_else(resting);
            for image in &model.images {
                let (rotation, shift) = image.placement(&poses[b]);
                let seen: Vec<Vec3> = (points.iter())
                    .map(|x| rotation.tr_mul(&(x - shift)))
                    .collect();
                let made = body.velocity(&q, phi.slice(&model.faces[b]), &seen);
                let turned = made.iter().map(|u| image.sign * (rotation * u));
                out.iter_mut().zip(turned).for_each(|(o, u)| *o += u);
            }
        }
        Ok(Some(out))
    }

    fn surfaces(&self) -> Option<&[Arc<PanelBoundary>]> {
        Some(&self.model.bodies)
    }

    /// On the CPU.
    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        check(motion, surfaces)?;
        self.surface_potentials_held(motion, &Arc::default())
    }

    /// On the CPU.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        check(motion, surfaces)?;
        check_bars(surfaces, bars)?;
        let (model, columns) = (self.model(), motion.columns());
        // A twist of every body, so that all have what reads their impulses.
        let all = DMatrix::from_element(columns.nrows(), 1, 1.0);
        let placed = PlacedPanels::new(model, motion.poses, &Arc::default(), &all)?;
        PanelSolution::of_potentials(Arc::new(placed), columns)?.potentials_vjp(motion, bars)
    }
}

impl Linearise for PanelCoupled {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        self.linearise_held(poses, basis, &Arc::default())
    }
}

impl HeldApart for PanelCoupled {
    fn panels(&self) -> &PanelCoupled {
        self
    }

    fn rename(&mut self, names: &[String]) {
        Arc::make_mut(&mut self.model).rename(names);
    }

    fn evaluate_held(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Momenta> {
        Ok(self.solved(poses, basis, films)?.value)
    }

    fn linearise_held<'a>(
        &'a self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Box<dyn Linearised + 'a>> {
        let linearised = self.solved(poses, basis, films)?.linearise()?;
        Ok(Box::new(linearised.with_shapes(self.shape_parameters())))
    }

    fn surface_potentials_held(
        &self,
        motion: &Motion,
        films: &Arc<PlacedFilms>,
    ) -> Result<Vec<SurfacePotential>> {
        let (model, columns) = (self.model(), motion.columns());
        let placed = PlacedPanels::new(model, motion.poses, films, &columns)?;
        PanelSolution::of_potentials(Arc::new(placed), columns)?.surface_potentials(motion)
    }
}
