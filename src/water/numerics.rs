//! Numbers that methods and fidelities work with, and what is chosen for each body.

use super::exchange::Exchange;
use crate::boundary::{self, Depth};
use crate::coupling::full::SolveSettings;
use crate::coupling::reduced::{Cutoff, compress};
use serde::{Deserialize, Serialize};

/// Discretisation, solve and compression.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Numerics {
    /// Fundamental solutions, where they are used. Where the sources are is the body method's choice, not this one's.
    pub mfs: boundary::MfsSettings,
    /// Coupled solve with the fidelity `full`.
    pub solve: SolveSettings,
    /// Compression with the fidelity `reduced`.
    pub compress: compress::CompressSettings,
    /// Error of M_f, relative to √(M_ii M_jj), that the fidelity `auto` aims at.
    pub accuracy: f64,
    /// Whether the water in gaps that aren't resolved is a film, with the fidelities `reduced` and `auto`, and with `full` by panels.
    pub films: bool,
    /// How compressed bodies are coupled.
    pub exchange: Exchange,
}

impl Default for Numerics {
    fn default() -> Self {
        Self {
            mfs: boundary::MfsSettings::default(),
            solve: SolveSettings::default(),
            compress: compress::CompressSettings::default(),
            accuracy: 0.01,
            films: true,
            exchange: Exchange::default(),
        }
    }
}

impl Numerics {
    /// The same of a body whose lengths are in units of `size` (m).
    pub(super) fn in_units_of(&self, size: f64) -> Self {
        let mut out = *self;
        if let Depth::Fixed(depth) = &mut out.mfs.depth {
            *depth /= size;
        }
        out
    }
}

/// What is chosen for each body and pair; empty: what the settings say.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    /// Per body.
    pub compress: Vec<compress::CompressSettings>,
    /// Per pair of bodies, equal for a body and its images.
    pub cutoffs: Vec<((usize, usize), Cutoff)>,
}
