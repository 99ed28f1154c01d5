//! How the coupled system is solved, whoever solves it.

use crate::boundary::{BodyBoundary, Method};
use crate::coupling::settings::check_limits;
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
    /// Iterations after which it gives up with an error.
    pub max_iterations: usize,
}

impl Default for SolveSettings {
    fn default() -> Self {
        Self {
            solver: FullSolver::default(),
            preconditioner: Preconditioner::default(),
            tolerance: 1e-8,
            max_iterations: 2000,
        }
    }
}

impl SolveSettings {
    pub(super) fn validate(&self, bodies: &[Arc<BodyBoundary>]) -> Result<()> {
        check_limits(self.tolerance, self.max_iterations)?;
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
