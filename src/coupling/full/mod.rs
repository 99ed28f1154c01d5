//! The paper's coupled system (Eq. 18–20) in least squares, with all derivatives.
//!
//! Rows of K are the faces of all bodies, columns their sources; with walls every source brings its
//! images. Per body twist x̄ (body frames), in the notation of [`crate::boundary`],
//!
//! ```text
//! K a ≈ F x̄,   r = F x̄ − K a,   λ = N⁻¹ Pᵀ B x̄,   μ = K λ,   N = KᵀK + D²
//! E(x, y) = sym( B_xᵀ P a_y )
//! M̄ x̄ = ½ { B₆ᵀ P a + F₆ᵀ μ }                             all six components of every body
//! δE(x, y) = ½ [ B_xᵀ δP a_y − μ_xᵀ δK a_y + r_xᵀ δK λ_y ] + (x ↔ y)
//! ```
//!
//! with D the constant damping of [`crate::boundary`]. A body's own block doesn't change in its own frame; all other entries depend on a source's
//! position in the target's frame alone, so a displacement enters through `d_j = Ẑ_c(s_j) − Z_b(s_j)`:
//! with the right densities fixed, δE is the work of a force on each source of c and of the
//! opposite wrench on b. Between bodies that don't feel each other ([`Exclusions`]) K and P have no
//! entries but those of images. The tangent (hvp) follows from
//!
//! ```text
//! N δa = δKᵀ r − Kᵀ δK a              δr = −δK a − K δa
//! N δλ = δPᵀ B x̄ − δKᵀ μ − Kᵀ δK λ      δμ = δK λ + K δλ
//! ```
//!
//! which is Eq. 21 done once, transposed, with the least-squares residual terms that Eq. 21 drops.
//!
//! What the system consists of is the [`Model`]; a [`SystemBackend`] computes with it, here [`Cpu`].

mod backend;
mod cpu;
mod model;
mod residual;
mod settings;

pub use backend::SystemBackend;
pub use cpu::Cpu;
pub use model::Model;
pub use settings::{FullSolver, Preconditioner, SolveSettings};

use super::response::{CoupledResponse, Solved};
use super::settings::check_asked;
use super::surface::{self, Charges, Seen};
use super::surface_back::{Back, onto_charges, pull_pair};
use super::{
    Coupling, Direction, Exclusions, Linearise, Linearised, Momenta, Motion, MotionBar,
    SurfacePotential,
};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::boundary::{BodyBoundary, PanelBoundary};
use crate::geometry::Wall;
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// All bodies coupled through one boundary integral system.
pub struct Full {
    model: Arc<Model>,
    backend: Box<dyn SystemBackend>,
}

impl Full {
    /// On the CPU, from the bodies, the walls (one, or mutually perpendicular ones), the pairs of bodies
    /// that don't feel each other, and the solver's settings.
    ///
    /// # Errors
    /// As [`Model::new`] and [`Cpu::new`].
    pub fn new(
        bodies: Vec<Arc<BodyBoundary>>,
        walls: &[Wall],
        excluded: Exclusions,
        settings: SolveSettings,
    ) -> Result<Self> {
        let model = Arc::new(Model::new(bodies, walls, excluded, settings)?);
        Ok(Self::on(model.clone(), Box::new(Cpu::new(model)?)))
    }

    /// On a backend made for the same model.
    pub fn on(model: Arc<Model>, backend: Box<dyn SystemBackend>) -> Self {
        Self { model, backend }
    }

    /// What the system consists of.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// What computes it.
    pub fn backend(&self) -> &dyn SystemBackend {
        self.backend.as_ref()
    }

    /// Strengths of all sources, and their rates where these are asked for: two columns.
    fn strengths(&self, motion: &Motion) -> Result<Columns> {
        let model = self.model();
        let columns = motion.columns();
        // Other backends don't tell rates of densities.
        let own;
        let backend: &dyn SystemBackend =
            match motion.rates.is_some() && model.bodies.iter().all(|b| b.factored()) {
                true => {
                    own = Cpu::new(self.model.clone())?;
                    &own
                }
                false => self.backend.as_ref(),
            };
        let response = backend.respond(motion.poses, &columns)?;
        let strengths = response.densities()?;
        let displaced = match motion.rates {
            Some(_) => {
                let first = DVector::from_column_slice(&[1.0, 0.0]);
                let moving = response.directions(&[Direction::Basis(&first)])?;
                moving.density_rates(motion.displacement)?
            }
            None => Columns::zeros(model.columns(), 1),
        };
        Ok(Columns::from_fn(model.columns(), 2, |j, k| match k {
            0 => strengths.at(j, 0),
            _ => strengths.at(j, 1) + displaced.at(j, 0),
        }))
    }

    fn solved(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
    ) -> Result<Solved<dyn CoupledResponse + '_>> {
        check_asked(self, poses, basis)?;
        let volume = |b: usize| self.model.bodies[b].faces.volume();
        Solved::new(self.backend.respond(poses, basis)?, basis, volume, 0.0)
    }
}

impl Coupling for Full {
    fn name(&self) -> &'static str {
        "the fidelity full"
    }

    fn bodies(&self) -> usize {
        self.model.bodies.len()
    }

    fn unknowns(&self) -> usize {
        self.model.columns()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        Ok(self.solved(poses, basis)?.value)
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    fn residual(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        let solved = self.solved(poses, basis)?;
        Ok(Some(residual::residual(
            &self.model,
            &solved,
            poses,
            basis,
        )?))
    }

    /// With strengths a of all bodies' sources and those of their images (s_j, of the same strength behind
    /// rigid walls), `u(x) = −∇φ = Σ_j a_j (x − s_j) / |x − s_j|³`. Bodies that don't feel each other are
    /// solved as if the other weren't there; the flow is the sum of theirs.
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
        let strengths = self.backend.respond(poses, &column)?.densities()?;
        let mut sources: Vec<(Vec3, f64)> = Vec::new();
        for image in &model.images {
            for ((body, range), pose) in model.bodies.iter().zip(&model.sources).zip(poses) {
                let (rotation, shift) = image.placement(pose);
                let placed = body.sources.iter().map(|s| rotation * s + shift);
                sources.extend(placed.zip(strengths.slice(range).iter().copied()));
            }
        }
        let at = |x: &Vec3| -> Vec3 {
            let of = |(s, a): &(Vec3, f64)| {
                let r = x - s;
                let square = r.norm_squared();
                r * (a / (square * square.sqrt()))
            };
            sources.iter().map(of).sum()
        };
        Ok(Some(points.par_iter().map(at).collect()))
    }

    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        surface::check(motion, surfaces)?;
        let model = self.model();
        let strengths = self.strengths(motion)?;
        let charges = (model.bodies.iter().zip(&model.sources)).map(|(body, range)| Charges {
            points: &body.sources,
            strengths: strengths.part(range),
        });
        let charges: Vec<Charges> = charges.collect();
        let seen: Vec<Seen> = (model.pairs(motion.poses).iter())
            .map(|pair| Seen {
                target: pair.target,
                source: pair.source,
                image: pair.image,
                weight: [1.0, 0.0],
            })
            .collect();
        let seen = |b: usize| seen.iter().filter(|s| s.target == b).copied().collect();
        Ok(surface::on_surfaces(motion, surfaces, &charges, seen, None))
    }

    /// On the CPU.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        surface::check(motion, surfaces)?;
        let Back { mut bar, densities } = onto_charges(surfaces, bars)?;
        let cpu = Cpu::new(self.model.clone())?;
        let model = self.model();
        let strengths = self.strengths(motion)?;
        let mut beta = Columns::zeros(model.columns(), 2);
        let bodies = model.bodies.len();
        let mut pulls = [vec![Vec6::zeros(); bodies], vec![Vec6::zeros(); bodies]];
        for pair in model.pairs(motion.poses) {
            let seen_by = (
                &surfaces[pair.target].faces.centres[..],
                &densities[pair.target],
            );
            let sources = (&model.sources[pair.source], &strengths);
            pull_pair(motion, &pair, seen_by, sources, &mut beta, &mut pulls);
        }
        bar.add_pull(motion.displacement, &pulls[0], &pulls[1]);
        cpu.strengths_vjp(motion, &beta, &mut bar)?;
        Ok(bar)
    }
}

impl Linearise for Full {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        Ok(Box::new(self.solved(poses, basis)?.linearise()?))
    }
}
