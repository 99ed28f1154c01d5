//! What the coupled system consists of.

use super::{FullSolver, Preconditioner, SolveSettings};
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::boundary::BodyBoundary;
use crate::coupling::Exclusions;
use crate::coupling::pair::Pair;
use crate::coupling::settings::{end, ranges};
use crate::geometry::{Image, Wall};
use crate::solver::InverseCholesky;
use std::ops::Range;
use std::sync::Arc;

/// What the coupled system consists of, whoever solves it: all that doesn't change with the poses.
pub struct Model {
    /// The bodies, each in its own frame; those of equal shape share one.
    pub bodies: Vec<Arc<BodyBoundary>>,
    /// Images that the walls make, in the world frame; the identity first.
    pub images: Vec<Image>,
    /// Pairs of bodies that don't feel each other but by images.
    pub excluded: Exclusions,
    /// How the system is solved.
    pub settings: SolveSettings,
    /// The bodies' sparse factors, where those precondition.
    pub sparse_factors: Vec<Option<Arc<InverseCholesky>>>,
    /// Rows of K of each body: its faces.
    pub faces: Vec<Range<usize>>,
    /// Columns of K of each body: its sources.
    pub sources: Vec<Range<usize>>,
}

impl Model {
    /// From the bodies, the walls (one, or mutually perpendicular ones), the pairs of bodies that
    /// don't feel each other, and the solver's settings.
    ///
    /// # Errors
    /// Walls that don't close under reflection, pairs of bodies that don't exist, or settings out of
    /// range.
    pub fn new(
        bodies: Vec<Arc<BodyBoundary>>,
        walls: &[Wall],
        excluded: Exclusions,
        settings: SolveSettings,
    ) -> Result<Self> {
        settings.validate(&bodies)?;
        excluded.check(bodies.len())?;
        Ok(Self {
            faces: ranges(bodies.iter().map(|b| b.faces.len())),
            sources: ranges(bodies.iter().map(|b| b.sources.len())),
            images: Image::of_rigid_walls(walls, "the fidelity full by fundamental solutions")?,
            excluded,
            sparse_factors: sparse_factors(&bodies, &settings)?,
            bodies,
            settings,
        })
    }

    /// Number of rows of K: the faces of all bodies.
    pub fn rows(&self) -> usize {
        end(&self.faces)
    }

    /// Number of columns of K: the sources of all bodies.
    pub fn columns(&self) -> usize {
        end(&self.sources)
    }

    /// The pairs of (target body, source body's image) whose placement changes: all but each body with
    /// its own sources and with those of bodies that it doesn't feel; images count always.
    pub(super) fn pairs(&self, poses: &[Pose]) -> Vec<Pair> {
        let mut out = Vec::new();
        for target in 0..self.bodies.len() {
            for image in &self.images {
                for source in 0..self.bodies.len() {
                    let apart = source == target || self.excluded.contains(source, target);
                    if apart && image.is_identity() {
                        continue;
                    }
                    let own = &self.bodies[source].sources;
                    let (at, from) = ((target, &poses[target]), (source, &poses[source]));
                    out.push(Pair::new(at, from, image, own));
                }
            }
        }
        out
    }
}

/// Sparse factors, one of bodies that share what they are: of all bodies where that is asked for, and in place of factors that weren't made.
fn sparse_factors(
    bodies: &[Arc<BodyBoundary>],
    settings: &SolveSettings,
) -> Result<Vec<Option<Arc<InverseCholesky>>>> {
    let mut out: Vec<Option<Arc<InverseCholesky>>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let asked = match settings.preconditioner {
            Preconditioner::Csd24 => settings.solver != FullSolver::Qr,
            Preconditioner::Factors => !body.factored() && settings.solver == FullSolver::Cgls,
            Preconditioner::Jacobi | Preconditioner::None => false,
        };
        let twin = bodies[..b]
            .iter()
            .position(|other| Arc::ptr_eq(other, body));
        out.push(match (asked, twin) {
            (false, _) => None,
            (true, Some(twin)) => out[twin].clone(),
            (true, None) => Some(Arc::new(body.sparse_factor(settings.csd24_rho)?)),
        });
    }
    Ok(out)
}
