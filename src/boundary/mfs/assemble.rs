//! Rows of one body: flux, twist, potential, and what other sources in its frame make there.

use super::BodyBoundary;
use super::settings::{Method, RowScaling};
use crate::adjoint::kernel::{
    Sources, Write, flux_fill, flux_hvp, flux_jvp, flux_vjp, normal_fill, normal_hvp, normal_jvp,
    normal_vjp, potential_hvp, potential_sum, potential_vjp,
};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::geometry::Faces;
use rayon::prelude::*;

/// Weight of each face's row. A row is `weight · flux` (vertex sources) or
/// `weight · normal velocity` (face sources).
pub(crate) fn row_weights(faces: &Faces, method: Method, rows: RowScaling) -> Vec<f64> {
    faces
        .areas
        .iter()
        .map(|a| match (rows, method) {
            (RowScaling::Unscaled, _) => 1.0,
            (RowScaling::Scaled, Method::MfsVertex) => 1.0 / a.sqrt(),
            (RowScaling::Scaled, Method::MfsFace) => a.sqrt(),
        })
        .collect()
}

/// F̄: what each row should be per unit twist, faces × 6.
pub(crate) fn twist_rows(faces: &Faces, method: Method, weights: &[f64]) -> Vec<Vec6> {
    (0..faces.len())
        .map(|i| match method {
            Method::MfsVertex => faces.twist_flux(i) * weights[i],
            Method::MfsFace => faces.twist_flux(i) * (weights[i] / faces.areas[i]),
        })
        .collect()
}

/// Columns whose norms [`BodyBoundary::column_norms`] takes at once.
const CHUNK: usize = 64;

/// An array that `kernel` adds to, unless there is nothing to add.
fn made(size: usize, kernel: impl FnOnce(&mut [f64])) -> Vec<f64> {
    let mut out = vec![0.0; size];
    if size > 0 {
        kernel(&mut out);
    }
    out
}

impl BodyBoundary {
    /// The rows that unit sources make, row-major faces × sources.
    pub(super) fn rows_of(&self, sources: &[Vec3]) -> Vec<f64> {
        let n = sources.len();
        let mut k = vec![0.0; self.faces.len() * n];
        self.fill(&Sources::new(sources), Write::Set, &mut k, n, 0);
        k
    }

    /// Norms of K's columns, without K.
    pub(super) fn column_norms(&self) -> Vec<f64> {
        let norms = |chunk: &[Vec3]| {
            let mut squares = vec![0.0; chunk.len()];
            for row in self.rows_of(chunk).chunks_exact(chunk.len()) {
                squares.iter_mut().zip(row).for_each(|(s, x)| *s += x * x);
            }
            squares.into_iter().map(f64::sqrt).collect::<Vec<_>>()
        };
        self.sources
            .par_chunks(CHUNK)
            .flat_map_iter(norms)
            .collect()
    }

    /// Entries of K for other sources in this body's frame.
    pub fn fill(&self, s: &Sources, write: Write, out: &mut [f64], stride: usize, column: usize) {
        match self.settings.method {
            Method::MfsVertex => flux_fill(&self.triangles, s, write, out, stride, column),
            Method::MfsFace => normal_fill(&self.points, s, write, out, stride, column),
        }
    }

    /// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`.
    pub fn jvp(&self, s: &Sources, d: &[Vec3], a: &[f64], columns: usize, out: &mut [f64]) {
        match self.settings.method {
            Method::MfsVertex => flux_jvp(&self.triangles, s, d, a, columns, out),
            Method::MfsFace => normal_jvp(&self.points, s, d, a, columns, out),
        }
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇K_ij`.
    pub fn vjp(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        made(3 * columns * s.len(), |out| match self.settings.method {
            Method::MfsVertex => flux_vjp(&self.triangles, s, bar, columns, out),
            Method::MfsFace => normal_vjp(&self.points, s, bar, columns, out),
        })
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇∇K_ij d_j`.
    pub fn hvp(&self, s: &Sources, d: &[Vec3], bar: &[f64], columns: usize) -> Vec<f64> {
        made(3 * columns * s.len(), |out| match self.settings.method {
            Method::MfsVertex => flux_hvp(&self.triangles, s, d, bar, columns, out),
            Method::MfsFace => normal_hvp(&self.points, s, d, bar, columns, out),
        })
    }

    /// `[j][k]: Σ_i bar[i][k] P_ij`.
    pub fn potential(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        made(columns * s.len(), |out| {
            potential_sum(&self.points, s, bar, columns, out)
        })
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇P_ij`.
    pub fn potential_vjp(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        made(3 * columns * s.len(), |out| {
            potential_vjp(&self.points, s, bar, columns, out)
        })
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇∇P_ij d_j`.
    pub fn potential_hvp(&self, s: &Sources, d: &[Vec3], bar: &[f64], columns: usize) -> Vec<f64> {
        made(3 * columns * s.len(), |out| {
            potential_hvp(&self.points, s, d, bar, columns, out)
        })
    }

    /// Rows of B̄ times a few twists, `[face][k]`.
    pub fn readout_rows(&self, twists: &[Vec6]) -> Vec<f64> {
        project(&self.readout_flux, twists)
    }

    /// Rows of F̄ times a few twists, `[face][k]`.
    pub fn twist_rows(&self, twists: &[Vec6]) -> Vec<f64> {
        project(&self.twist_rows, twists)
    }
}

fn project(rows: &[Vec6], twists: &[Vec6]) -> Vec<f64> {
    let mut out = Vec::with_capacity(rows.len() * twists.len());
    for row in rows {
        out.extend(twists.iter().map(|t| row.dot(t)));
    }
    out
}
