//! The panel method, asked for the flow outside.

use super::PanelBoundary;
use crate::Result;
use crate::adjoint::kernel::Write;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::boundary::Response;
use faer::{Mat, MatRef};
use std::f64::consts::PI;

impl Response for PanelBoundary {
    fn added_mass(&self) -> Mat6 {
        self.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let (q, phi) = (self.normal_velocity.as_ref(), self.potential.as_ref());
        let out = self.panels.potential(points, Some(q), Some(phi));
        Ok(MatRef::from_row_major_slice(&out, points.len(), 6).to_owned())
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let (n, columns) = (self.faces.len(), sources.len());
        // The wall condition: q = +∂φ_inc/∂n, whose mean over a panel is −Ω/A.
        let mut q = vec![0.0; n * columns];
        self.panels
            .double_layer(sources, Write::Set, &mut q, columns, 0);
        for (q, area) in q.chunks_exact_mut(columns.max(1)).zip(&self.faces.areas) {
            q.iter_mut().for_each(|q| *q *= -4.0 * PI / area);
        }
        let q = MatRef::from_row_major_slice(&q, n, columns);
        let right = self.panels.potential(&self.faces.centres, Some(q), None);
        let mut phi = MatRef::from_row_major_slice(&right, n, columns).to_owned();
        self.lu.solve(phi.as_mut());
        let out = self.panels.potential(points, Some(q), Some(phi.as_ref()));
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
