//! The method of fundamental solutions, asked for the flow outside.

use super::{BodyBoundary, Method};
use crate::Result;
use crate::adjoint::kernel::{Sources, Write, flux_fill, normal_fill};
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::response::Response;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

/// `1/|x_i − s_j|`, points × sources.
fn potentials(points: &[Vec3], sources: &[Vec3]) -> Mat<f64> {
    Mat::from_fn(points.len(), sources.len(), |i, j| {
        1.0 / (points[i] - sources[j]).norm()
    })
}

impl Response for BodyBoundary {
    fn added_mass(&self) -> Mat6 {
        self.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let alpha = Mat::from_fn(self.sources.len(), 6, |j, k| self.strengths[j][k]);
        Ok(potentials(points, &self.sources) * alpha)
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let (n, p) = (self.faces.len(), sources.len());
        let mut rows = vec![0.0; n * p];
        let s = Sources::new(sources);
        match self.settings.method {
            Method::MfsVertex => flux_fill(&self.triangles, &s, Write::Set, &mut rows, p, 0),
            Method::MfsFace => normal_fill(&self.points, &s, Write::Set, &mut rows, p, 0),
        }
        let rows = MatRef::from_row_major_slice(&rows, n, p);
        // (KᵀK + D²) α = −Kᵀ k(y)
        let mut alpha = Mat::zeros(self.sources.len(), p);
        let (add, k) = (Accum::Replace, self.flux_matrix().transpose());
        matmul(alpha.as_mut(), add, k, rows, -1.0, Par::Seq);
        self.solve_factor_transpose(alpha.as_mut());
        self.solve_factor(alpha.as_mut());
        Ok(potentials(points, &self.sources) * alpha)
    }

    fn asymmetry(&self) -> f64 {
        self.asymmetry
    }

    fn condition(&self) -> f64 {
        self.condition
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}
