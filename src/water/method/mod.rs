//! Methods by which a body's own answer to the water is computed.
//!
//! A method is a file here that implements [`kind::BodyMethod`], its `mod` line, and its line in the list.

mod auto;
mod exact;
pub(super) mod kind;
mod mfs;
mod panel;

use crate::boundary;
use kind::BodyMethod;

listed! {
    /// The method by which a body alone is solved.
    pub enum Method as BodyMethod {
        /// The most accurate that costs nothing at run time: `exact` where there is a formula, else `panel`; with the fidelity
        /// `full` `panel`.
        #[default]
        Auto => auto::Auto,
        /// Closed forms, for spheres and ellipsoids by formula.
        Exact => exact::Exact,
        /// Direct boundary elements: no sources inside, and right in narrow gaps.
        Panel => panel::Panel,
        /// A source under each vertex, exact flux through each face, least squares.
        MfsVertex => mfs::Mfs(boundary::Method::MfsVertex),
        /// A source under each face, velocity at face centres (the paper's Eq. 17–18).
        MfsFace => mfs::Mfs(boundary::Method::MfsFace),
    }
}

impl Method {
    /// The method by which all bodies are solved together (fidelity `full`) where this one is asked for.
    pub fn together(self) -> Self {
        match self {
            Self::Auto => Self::Panel,
            method => method,
        }
    }
}
