//! How far the added mass of a scene is to be trusted.

mod case;
mod levels;

use super::{Fidelity, Simulator};
use crate::Result;
use case::Case;
use serde::Serialize;

pub use levels::Level;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorEstimate {
    pub total: Option<f64>,
    pub asymmetry: f64,
    pub residual: Option<f64>,
    pub extrapolation: Option<f64>,
    pub coupling: Option<f64>,
    pub solver: f64,
    pub levels: Vec<Level>,
    pub missing: Vec<String>,
}

impl Simulator {
    /// An estimate of the error of [`Simulator::added_mass`].
    ///
    /// # Errors
    /// Whatever the coupling reports.
    pub fn error_estimate(&self) -> Result<ErrorEstimate> {
        let case = Case::new(self)?;
        let mut missing = Vec::new();
        let residual = case.residual()?;
        let levels = levels::levels(&case, &mut missing);
        let extrapolation = levels.iter().map(|l| l.error).reduce(f64::max);
        let coupling = if self.fidelity() == Fidelity::Isolated {
            case.missing_coupling(&mut missing)
        } else {
            None
        };
        let asymmetry = self
            .discretisation()
            .iter()
            .map(|d| d.asymmetry)
            .fold(case.report.asymmetry, f64::max);
        Ok(ErrorEstimate {
            total: None,
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
