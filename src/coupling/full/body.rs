//! One body as the coupled system sees it: constant geometry, its own block, its factor.

use crate::adjoint::kernel::{
    Sources, Write, flux_fill, flux_hvp, flux_jvp, flux_vjp, normal_fill, normal_hvp, normal_jvp,
    normal_vjp, potential_hvp, potential_sum, potential_vjp,
};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::boundary::{BodyBoundary, Method};
use std::sync::Arc;

/// A body of the coupled system, in its own frame; bodies of equal shape share one.
#[derive(Clone, Debug)]
pub struct MfsBody {
    /// The body alone.
    pub boundary: Arc<BodyBoundary>,
}

impl MfsBody {
    /// From the body's discretisation.
    pub fn new(boundary: Arc<BodyBoundary>) -> Self {
        Self { boundary }
    }

    /// Number of rows.
    pub fn faces(&self) -> usize {
        self.boundary.faces.len()
    }

    /// Number of unknowns.
    pub fn sources(&self) -> usize {
        self.boundary.sources.len()
    }

    /// Entries of K for other sources in this body's frame.
    pub fn fill(&self, s: &Sources, write: Write, out: &mut [f64], stride: usize, column: usize) {
        match self.boundary.settings.method {
            Method::MfsVertex => flux_fill(&self.boundary.triangles, s, write, out, stride, column),
            Method::MfsFace => normal_fill(&self.boundary.points, s, write, out, stride, column),
        }
    }

    /// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`.
    pub fn jvp(&self, s: &Sources, d: &[Vec3], a: &[f64], columns: usize, out: &mut [f64]) {
        match self.boundary.settings.method {
            Method::MfsVertex => flux_jvp(&self.boundary.triangles, s, d, a, columns, out),
            Method::MfsFace => normal_jvp(&self.boundary.points, s, d, a, columns, out),
        }
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇K_ij`.
    pub fn vjp(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; 3 * columns * s.len()];
        if columns > 0 {
            match self.boundary.settings.method {
                Method::MfsVertex => flux_vjp(&self.boundary.triangles, s, bar, columns, &mut out),
                Method::MfsFace => normal_vjp(&self.boundary.points, s, bar, columns, &mut out),
            }
        }
        out
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇∇K_ij d_j`.
    pub fn hvp(&self, s: &Sources, d: &[Vec3], bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; 3 * columns * s.len()];
        if columns > 0 {
            match self.boundary.settings.method {
                Method::MfsVertex => {
                    flux_hvp(&self.boundary.triangles, s, d, bar, columns, &mut out)
                }
                Method::MfsFace => normal_hvp(&self.boundary.points, s, d, bar, columns, &mut out),
            }
        }
        out
    }

    /// `[j][k]: Σ_i bar[i][k] P_ij`.
    pub fn potential(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; columns * s.len()];
        if columns > 0 {
            potential_sum(&self.boundary.points, s, bar, columns, &mut out);
        }
        out
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇P_ij`.
    pub fn potential_vjp(&self, s: &Sources, bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; 3 * columns * s.len()];
        if columns > 0 {
            potential_vjp(&self.boundary.points, s, bar, columns, &mut out);
        }
        out
    }

    /// `[j][k][3]: Σ_i bar[i][k] ∇∇P_ij d_j`.
    pub fn potential_hvp(&self, s: &Sources, d: &[Vec3], bar: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; 3 * columns * s.len()];
        if columns > 0 {
            potential_hvp(&self.boundary.points, s, d, bar, columns, &mut out);
        }
        out
    }

    /// Rows of B̄ times a few twists, `[face][k]`.
    pub fn readout_rows(&self, twists: &[Vec6]) -> Vec<f64> {
        project(&self.boundary.readout_flux, twists)
    }

    /// Rows of F̄ times a few twists, `[face][k]`.
    pub fn twist_rows(&self, twists: &[Vec6]) -> Vec<f64> {
        project(&self.boundary.twist_rows, twists)
    }
}

fn project(rows: &[Vec6], twists: &[Vec6]) -> Vec<f64> {
    let mut out = Vec::with_capacity(rows.len() * twists.len());
    for row in rows {
        out.extend(twists.iter().map(|t| row.dot(t)));
    }
    out
}

/// The six unit twists.
pub fn unit_twists() -> [Vec6; 6] {
    std::array::from_fn(|k| Vec6::ith(k, 1.0))
}
