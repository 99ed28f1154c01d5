//! How the coupled system is solved, whoever solves it.

use crate::boundary::{BodyBoundary, Method};
use crate::coupling::settings::check_limits;
use crate::solver::LEAST_RHO;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

choices! {
    /// How the coupled system is solved.
    pub enum FullSolver {
        /// Conjugate gradients on the least-squares problem (Eq. 20).
        #[default]
        Cgls,
        /// A dense factorisation, as a reference: QR, or LU with the method panel.
        Qr,
        /// GMRES; for the square systems of `mfs-face` (Eq. 18, and its transpose) and `panel` only.
        Gmres,
    }
}

choices! {
    /// Right preconditioner of the iterative solvers.
    pub enum Preconditioner {
        /// Each body's own factorisation, made once.
        #[default]
        Factors,
        /// The diagonal (column norms).
        Jacobi,
        /// Each body's own sparse inverse Cholesky factor, made once: what bodies have on a GPU that are too large for a dense one.
        Csd24,
        /// None.
        None,
    }
}

/// Settings of the coupled solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolveSettings {
    /// The solver.
    pub solver: FullSolver,
    /// Its preconditioner.
    pub preconditioner: Preconditioner,
    /// Relative residual at which it stops: ‖R⁻ᵀ(g − KᵀKx)‖ ≤ tolerance ‖R⁻ᵀg‖ for CGLS,
    /// ‖b − Kx‖ ≤ tolerance ‖b‖ for GMRES.
    pub tolerance: f64,
    /// Iterations after which it gives up with an error. Where this is the default the coupled panels of a scene give up after 500.
    pub max_iterations: usize,
    /// ρ of [`Preconditioner::Csd24`], 1 to 20: how far, in its own scales, a source of a body reaches others of it.
    pub csd24_rho: f64,
}

/// ρ in which the whole solve is soonest done, with the factor's making: see the figure that compares them.
const RHO: f64 = 3.0;
/// With a larger ρ the factor is hardly sparse.
const MOST_RHO: f64 = 20.0;

impl Default for SolveSettings {
    fn default() -> Self {
        Self {
            solver: FullSolver::default(),
            preconditioner: Preconditioner::default(),
            tolerance: 1e-8,
            max_iterations: 2000,
            csd24_rho: RHO,
        }
    }
}

impl SolveSettings {
    pub(super) fn validate(&self, bodies: &[Arc<BodyBoundary>]) -> Result<()> {
        check_limits(self.tolerance, self.max_iterations)?;
        if !(LEAST_RHO..=MOST_RHO).contains(&self.csd24_rho) {
            return Err(Error::input(
                "settings: csd24_rho",
                self.csd24_rho,
                "must lie between 1 and 20, e.g. 3",
            ));
        }
        if self.solver != FullSolver::Gmres {
            return Ok(());
        }
        if let Some(body) = bodies.iter().find(|b| b.settings.method != Method::MfsFace) {
            return Err(Error::Unsupported {
                what: format!("GMRES for body \"{}\"", body.name),
                why: "its system isn't square (vertex sources, a row per face)".into(),
                instead: "use --method mfs-face, or the solver cgls".into(),
            });
        }
        match bodies.iter().find(|b| b.settings.damping != 0.0) {
            None => Ok(()),
            Some(body) => Err(Error::input(
                format!("body \"{}\": damping", body.name),
                body.settings.damping,
                "must be 0 for GMRES, which solves the square system as it is",
            )),
        }
    }
}
