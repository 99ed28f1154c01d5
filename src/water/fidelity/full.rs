//! All bodies solved together, at the resolution of their meshes.

use super::kind::{FidelityKind, Knob};
use crate::Result;
use crate::geometry::Gap;
use crate::water::device::Device;
use crate::water::method::kind::Problem;
use crate::water::submerged::Made;

/// Gaps narrower than this many edges are left to contact.
const CONTACT: f64 = 0.5;

/// What the residual is worth in the error: near a source it is large, and of the first order where the error is of the second.
const RESIDUAL: f64 = 0.25;

/// The coupled system of all bodies.
pub(super) struct Full;

impl FidelityKind for Full {
    fn knobs(&self) -> &'static [Knob] {
        &[Knob::Tolerance, Knob::Films]
    }

    fn solves_alone(&self) -> bool {
        false
    }

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        problem.method.couple(problem, device)
    }

    fn resolved_gap(&self, _: f64, edge: f64) -> f64 {
        CONTACT * edge
    }

    fn gap_warning(
        &self,
        gap: &Gap,
        edges: f64,
        place: &str,
        time: &str,
        hint: &str,
    ) -> Option<String> {
        let part = match edges {
            0.5 => "half".into(),
            _ => format!("{edges} of"),
        };
        (gap.distance < edges * gap.edge).then(|| {
            format!(
                "{place}: the smallest gap, {:.3e} m at t = {time} s, is narrower than {part} \
                 the edges there ({:.3e} m): forces across it may be off by several percent \
                 and more; use more faces, refine the bodies there (`refine`), or end the run \
                 before{hint}",
                gap.distance.max(0.0),
                gap.edge
            )
        })
    }

    fn error(&self, bodies: f64, residual: Option<f64>, _: Option<f64>) -> Option<f64> {
        let residual = (RESIDUAL * residual.unwrap_or(0.0)).min(1.0);
        Some(bodies.max(residual))
    }
}
