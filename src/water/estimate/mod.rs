//! How far the added mass of a scene may be trusted.
//!
//! Errors of M_f are `max |ΔM_ij| / √(M_ii M_jj)`, along world axes about each body's origin; a direction that
//! hardly moves water (a round body's spin) counts as a hundredth of the water displaced. With the order
//! p of the error in 1/faces (1 on smooth bodies, ½ with sharp edges, ⅔ for smooth meshes from files,
//! whose facets are the shape), the estimate is
//!
//! ```text
//! total = 1.5 · [ max(extrapolation, asymmetry, min(residual/4, 1)) ]      fidelity full
//!         1.5 · [ max(extrapolation, asymmetry) + residual ]               reduced
//!         1.5 · [ max(extrapolation, asymmetry) + coupling ]               isolated
//! extrapolation = max over meshes n' of |M(n') − M(n)| / |(n/n')ᵖ − 1|
//! ```
//!
//! and the residual of the iterative solver on top. What the parts are stands with
//! [`ErrorEstimate`]. The factors were chosen so that the estimate is never under a third of the true error
//! where that is known, and not far over it: `docs/accuracy-estimate.md`.

mod case;
mod levels;

use crate::Result;
use case::Case;
use serde::Serialize;

pub(crate) use case::Subject;
pub use levels::Level;

/// On all parts together.
const SAFETY: f64 = 1.5;

/// An estimate of the error of [`crate::Simulator::added_mass`]: `max |ΔM_ij| / √(M_ii M_jj)`, all numbers
/// dimensionless.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// The estimate, from the parts below. `None` where a part that it needs couldn't be had:
    /// `missing` says which and why.
    pub total: Option<f64>,
    /// Largest asymmetry before symmetrising, of all bodies together and of each by itself; 0 for
    /// methods that are symmetric by construction. Mostly far below the error.
    pub asymmetry: f64,
    /// What is left at check points that weren't used in the fit. Fidelity `Full`: what the normal
    /// velocities left between the collocation points change in the energy, at four points a face.
    /// `Reduced`: what the bodies' own methods, asked for their answers to one another at this
    /// configuration, change in M_f to first order, pairs that fade out included; where a gap is narrower
    /// than they resolve, times the root of resolved over actual gap. Of both, with films, also a fifth of
    /// what these add: all that there is of coupled panels, for which it is `None` without films, as for `Isolated`.
    pub residual: Option<f64>,
    /// What other meshes of the same bodies change, extrapolated to infinitely fine ones. 0 where every
    /// body is solved by formula; `None` where it couldn't be had.
    pub extrapolation: Option<f64>,
    /// The coupling that the fidelity `Isolated` leaves out, between bodies and to walls, from coupled
    /// panels on coarse meshes; `None` with other fidelities, or where it couldn't be had.
    pub coupling: Option<f64>,
    /// Relative residual at which the iterative solver stopped; 0 for direct solves.
    pub solver: f64,
    /// The meshes that `extrapolation` compares.
    pub levels: Vec<Level>,
    /// What couldn't be had, and why.
    pub missing: Vec<String>,
}

impl Subject<'_> {
    /// Estimates the error of the added mass, from the asymmetry, from what is left at check points, and from other
    /// meshes of the same bodies.
    pub fn error_estimate(self) -> Result<ErrorEstimate> {
        let case = Case::new(self)?;
        let fidelity = case.fidelity;
        let mut missing = case.unknown();
        let known = missing.is_empty();
        let residual = case.residual()?;
        let (levels, extrapolation) = levels::extrapolate(&case, &mut missing);
        let coupling = match fidelity.coupled() {
            false => case.missing_coupling(&mut missing),
            true => None,
        };
        let own = self.water.discretisation.iter().map(|d| d.asymmetry);
        let asymmetry = own.fold(case.report.asymmetry, f64::max);
        let total = extrapolation.filter(|_| known).and_then(|extrapolation| {
            let bodies = extrapolation.max(asymmetry);
            let together = fidelity.kind().error(bodies, residual, coupling)?;
            Some(SAFETY * together + case.report.residual)
        });
        Ok(ErrorEstimate {
            total,
            asymmetry,
            residual,
            extrapolation,
            coupling,
            solver: case.report.residual,
            levels,
            missing,
        })
    }
}
