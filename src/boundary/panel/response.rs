//! The panel method, asked for the flow outside.

use super::PanelBoundary;
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::response::Response;
use faer::{Mat, MatRef};

impl Response for PanelBoundary {
    fn added_mass(&self) -> Mat6 {
        self.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let (q, phi) = (self.normal_velocity.as_ref(), self.potential.as_ref());
        let out = self.panels.potential(points, Some(q), Some(phi));
        Ok(MatRef::from_row_major_slice(&out, points.len(), 6).to_owned())
    }

    /// The total potential is solved for: with no normal velocity on the body it answers
    /// `(½I + Ω/4π) φ_t = φ_inc`, and the incoming flow, harmonic inside, drops out of Green's
    /// identity for the rest, `φ_s(x) = −Σ Ω_j(x)/4π φ_t,j`. No single layer is needed, and the
    /// error is smaller than with `(½I + Ω/4π) φ_s = S ∂φ_inc/∂n`.
    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let (n, columns) = (self.faces.len(), sources.len());
        let centres = &self.faces.centres;
        let mut total = Mat::from_fn(n, columns, |i, j| 1.0 / (centres[i] - sources[j]).norm());
        self.lu.solve(total.as_mut());
        let out = self.panels.potential(points, None, Some(total.as_ref()));
        Ok(MatRef::from_row_major_slice(&out, points.len(), columns).to_owned())
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
