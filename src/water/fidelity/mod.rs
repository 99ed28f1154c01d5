//! How much of the coupling is modelled.
//!
//! A fidelity is a file here that implements [`kind::FidelityKind`], its `mod` line, and its line in the list.

mod auto;
mod compressed;
mod finer;
mod full;
mod given;
mod isolated;
pub(super) mod kind;
mod reduced;

use crate::Result;
use crate::water::device::Device;
use crate::water::method::kind::Problem;
use crate::water::submerged::Made;
use kind::FidelityKind;

pub(super) use isolated::own_added_mass;
pub use kind::Knob;
pub(super) use reduced::{compressed_all, responses};

listed! {
    /// How much of the water's coupling is solved: see [`crate::coupling`].
    pub enum Fidelity as FidelityKind {
        /// Each body as if it were alone in the water, with its own constant added mass (Eq. 12); no walls.
        Isolated => isolated::Isolated,
        /// All bodies coupled, each compressed to a few sources; walls as images.
        Reduced => reduced::Reduced,
        /// `reduced`, with what each body and pair needs chosen for the scene.
        #[default]
        Auto => auto::Auto,
        /// All bodies coupled, at the resolution of their meshes (Eq. 18–20); walls as images.
        Full => full::Full,
    }
}

impl Fidelity {
    /// Whether the bodies feel each other and the walls at all.
    pub fn coupled(self) -> bool {
        self.kind().coupled()
    }

    /// The coupling of the bodies, with given added masses in the place of their own.
    ///
    /// # Errors
    /// Bodies that the method or the fidelity can't take, or whatever the discretisation reports.
    pub(super) fn couple(self, problem: &Problem, device: &mut Device) -> Result<Made> {
        given::put(problem, self.kind().couple(problem, device)?)
    }

    /// The choices that it looks at, of those that not all do.
    pub fn knobs(self) -> &'static [Knob] {
        self.kind().knobs()
    }
}
