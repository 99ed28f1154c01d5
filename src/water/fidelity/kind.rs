//! What a fidelity must answer.

use crate::Result;
use crate::adjoint::lie::Pose;
use crate::geometry::Gap;
use crate::water::device::Device;
use crate::water::method::kind::Problem;
use crate::water::numerics::{Numerics, Plan};
use crate::water::submerged::Made;

/// Choices that only some fidelities look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knob {
    /// Points of a compressed body.
    Rank,
    /// Smallest gap that compressed bodies resolve.
    ResolvedGap,
    /// Whether gaps that aren't resolved have films.
    Films,
    /// The error aimed at.
    Accuracy,
    /// Residual at which the coupled solve stops.
    Tolerance,
}

/// What a fidelity chooses for a scene, and why.
#[derive(Default)]
pub(crate) struct Planned {
    pub plan: Plan,
    pub reasons: Vec<String>,
}

/// A gap between bodies at the start, or to a wall.
pub(crate) struct StartGap {
    /// By the numbers of the bodies in the water.
    pub gap: Gap,
    /// Energy of the film between parallel parts, in that of the water that the smaller body displaces.
    pub film: f64,
}

/// The gaps at the start that are under a distance, m.
pub(crate) type GapsWithin<'a> = dyn Fn(f64) -> Vec<StartGap> + 'a;

/// A model of how the bodies feel each other.
pub(crate) trait FidelityKind: Send + Sync {
    /// The choices that it alone, or with others, looks at.
    fn knobs(&self) -> &'static [Knob];

    /// Whether the bodies feel each other and the walls at all.
    fn coupled(&self) -> bool {
        true
    }

    /// Whether each body is solved alone, by its own method, before it is coupled.
    fn solves_alone(&self) -> bool {
        true
    }

    /// Whether it chooses for a scene what bodies resolve.
    fn chooses(&self) -> bool {
        false
    }

    /// The error that it aims at with these numbers, if it does.
    fn aim(&self, _: &Numerics) -> Option<f64> {
        None
    }

    /// Whether bodies are compressed: their own methods then check the coupling, and gaps count against what they resolve.
    fn compresses(&self) -> bool {
        false
    }

    /// What it chooses for bodies that start at `poses`, if it does; `within` gives the gaps under a distance (m) between them and to the walls.
    ///
    /// # Errors
    /// An accuracy out of range, or bodies that no choice is known for.
    fn plan(&self, _: &Problem, _: &[Pose], _: &GapsWithin) -> Result<Planned> {
        Ok(Planned::default())
    }

    /// The coupling of the bodies.
    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made>;

    /// Why a GPU has nothing to compute, if it hasn't.
    fn idle_gpu(&self) -> Option<&'static str> {
        None
    }

    /// The gap that it resolves where compressed bodies resolve `compressed` and the mesh has edges of `edge`, m.
    fn resolved_gap(&self, compressed: f64, edge: f64) -> f64;

    /// What the user should know of the smallest gap of a run, where the method resolves `edges` of an edge, `place` and `time` in words; `hint` is how the two bodies may be
    /// declared to overlap.
    fn gap_warning(
        &self,
        gap: &Gap,
        edges: f64,
        place: &str,
        time: &str,
        hint: &str,
    ) -> Option<String>;

    /// The error of the added mass, without the solver's, from that of the `bodies` themselves (from other meshes and from
    /// asymmetry) and the other parts of [`crate::simulate::ErrorEstimate`]; `None` where one that it needs is missing.
    fn error(&self, bodies: f64, residual: Option<f64>, coupling: Option<f64>) -> Option<f64>;
}
