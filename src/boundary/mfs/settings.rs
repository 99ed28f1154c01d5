//! What a user may choose about the discretisation of one body.

use serde::{Deserialize, Serialize};

/// Discretisation of one body's surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MfsSettings {
    /// Where the sources are and what a row says.
    pub method: Method,
    /// How far inside the surface the sources are.
    pub depth: Depth,
    /// Norm in which the rows are fitted.
    pub rows: RowScaling,
    /// How the energy is read from the strengths.
    pub readout: Readout,
    /// Weight of the source strengths in the least squares, relative to the norms of K's columns.
    /// It suppresses patterns of sources that make no flux through any face (grids of right-angled
    /// triangles have them) and bounds the condition number by about 10/damping. 0: none.
    pub damping: f64,
}

impl Default for MfsSettings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            depth: Depth::default(),
            rows: RowScaling::default(),
            readout: Readout::default(),
            damping: 3e-3,
        }
    }
}

impl MfsSettings {
    /// No damping, and the potential read at face centres: the equations as published.
    pub fn plain(method: Method, depth: Depth) -> Self {
        Self {
            method,
            depth,
            readout: Readout::Centre,
            damping: 0.0,
            ..Self::default()
        }
    }
}

/// Where the sources are and what a row of the flux matrix says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// One source under each vertex (with automatic depth, one per side at sharp edges); a row is the flux through a face (its solid angle seen from the
    /// source). About twice as many rows as columns, solved by least squares.
    #[default]
    MfsVertex,
    /// One source under each face; a row is the normal velocity at the face's centre
    /// (the paper's Eq. 17–18). Square.
    MfsFace,
}

/// Distance of the sources from the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Depth {
    /// From the mesh, source by source: see [`super::depth`].
    #[default]
    Auto,
    /// The same everywhere, m. Checked against edge length and thickness.
    Fixed(f64),
}

choices! {
    /// Norm in which the rows are fitted.
    pub enum RowScaling {
        /// The L² norm of the normal velocity: small and large faces, and small and large bodies, count alike.
        #[default]
        Scaled,
        /// Plain least squares of the flux (vertex sources) or of the normal velocity (face sources); ruins small bodies beside
        /// large ones.
        Unscaled,
    }
}

/// How the energy is read from the strengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Readout {
    /// Second order in the residual, with three points on faces whose sources are near: see
    /// [`super::readout`].
    #[default]
    Corrected,
    /// The potential at each face's centre times the flux asked for (the paper's Eq. 19).
    Centre,
}
