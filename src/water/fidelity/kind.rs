//! What a fidelity must answer.

use crate::Result;
use crate::adjoint::lie::Pose;
use crate::coupling::reduced::{Cutoff, compress};
use crate::geometry::{Gap, Wall};
use crate::water::device::Device;
use crate::water::method::kind::BodyMethod;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Around, Made, SubmergedBody};

/// Choices that only some fidelities look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knob {
    /// Points of a compressed body.
    Rank,
    /// Smallest gap that compressed bodies resolve.
    ResolvedGap,
    /// The error aimed at.
    Accuracy,
    /// Residual at which the coupled solve stops.
    Tolerance,
}

/// What is chosen for each body and pair; empty: what the settings say.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    /// Per body.
    pub compress: Vec<compress::CompressSettings>,
    /// Per pair of bodies, equal for a body and its images.
    pub cutoffs: Vec<((usize, usize), Cutoff)>,
}

/// The fidelity to use, what each body and pair gets, and why.
pub(crate) struct Planned {
    pub fidelity: &'static dyn FidelityKind,
    pub plan: Plan,
    pub reasons: Vec<String>,
}

impl Planned {
    /// A fidelity with what the settings say.
    pub fn plain(fidelity: &'static dyn FidelityKind) -> Self {
        Self {
            fidelity,
            plan: Plan::default(),
            reasons: Vec::new(),
        }
    }
}

/// The bodies in the water at the start.
pub(crate) struct Start<'a> {
    pub bodies: &'a [SubmergedBody<'a>],
    pub poses: &'a [Pose],
    /// Gaps between them and to the walls, by their numbers among `bodies`.
    pub gaps: &'a dyn Fn() -> Vec<Gap>,
    pub walls: &'a [Wall],
}

/// Parts of the error of an added mass; see [`crate::simulate::ErrorEstimate`].
pub(crate) struct ErrorParts {
    /// Of the bodies themselves: from other meshes and from asymmetry.
    pub bodies: f64,
    pub residual: Option<f64>,
    pub coupling: Option<f64>,
}

/// A model of how the bodies feel each other.
pub(crate) trait FidelityKind: Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

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

    /// Whether it chooses another for a scene.
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

    /// What is used for a scene: itself, unless it chooses.
    ///
    /// # Errors
    /// An accuracy out of range, or bodies that no choice is known for.
    fn plan(&self, start: &Start, numerics: &Numerics) -> Result<Planned>;

    /// The coupling of `bodies`.
    ///
    /// # Errors
    /// Bodies without a shape where one is needed, or whatever the discretisation reports.
    fn couple(
        &self,
        bodies: &[SubmergedBody],
        around: &Around,
        method: &'static dyn BodyMethod,
        numerics: &Numerics,
        plan: &Plan,
        device: &mut Device,
    ) -> Result<Made>;

    /// Whether a GPU has something to compute with this method; if not, why.
    ///
    /// # Errors
    /// A method whose coupling is computed on the CPU alone.
    fn idle_gpu(&self, _: &dyn BodyMethod) -> Result<Option<&'static str>> {
        Ok(None)
    }

    /// The gap that it resolves where compressed bodies resolve `compressed` and the mesh has edges of `edge`, m.
    fn resolved_gap(&self, compressed: f64, edge: f64) -> f64;

    /// What the user should know of the smallest gap of a run, `place` and `time` in words; `hint` is how the two bodies may be
    /// declared to overlap.
    fn gap_warning(&self, gap: &Gap, place: &str, time: &str, hint: &str) -> Option<String>;

    /// The error of the added mass from its parts, without the solver's; `None` where one that it needs is missing.
    fn error(&self, parts: &ErrorParts) -> Option<f64>;
}
