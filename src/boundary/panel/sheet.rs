//! The velocity that panels make, up to the surface.
//!
//! Panels of constant potential are rings of vortices, which show within an edge of the surface. With the potential interpolated
//! linearly between vertices, the double layer is a sheet of vorticity, constant on each panel, and its velocity a cross product
//! with the gradient of the single layer (∇_s φ the surface gradient, n the normal into the fluid):
//!
//! ```text
//! u(x) = −∇φ = Σ_j { γ_j × ∇I_j − q_j ∇I_j } / 4π,   γ_j = n_j × ∇_s φ_j,   I_j = ∫_j 1/|x − y| dA
//! ```
//!
//! # References
//! J. L. Hess, "Calculation of potential flow about arbitrary three-dimensional lifting bodies", report MDC J5679-01, Douglas
//! Aircraft (1972), appendix A (a doublet sheet as one of vorticity).

use super::PanelBoundary;
use crate::adjoint::kernel::{Sources, single_vjp};
use crate::adjoint::lie::Vec3;

/// Columns of densities: a normal velocity and three components of vorticity.
const DENSITIES: usize = 4;

impl PanelBoundary {
    /// Velocity at points outside (body frame, m) for normal velocities `q` (m/s) and potentials `phi` (m²/s) of the panels:
    /// m/s, body frame.
    pub(crate) fn velocity(&self, q: &[f64], phi: &[f64], points: &[Vec3]) -> Vec<Vec3> {
        let vorticity = self.vorticity(phi);
        let densities: Vec<f64> = q
            .iter()
            .zip(&vorticity)
            .flat_map(|(q, g)| [*q, g.x, g.y, g.z])
            .collect();
        let sources = Sources::new(points);
        let mut fields = vec![0.0; 3 * DENSITIES * points.len()];
        let triangles = self.panels.triangles();
        single_vjp(triangles, &sources, &densities, DENSITIES, &mut fields);
        let of = |f: &[f64]| {
            let [q, x, y, z] = [0, 3, 6, 9].map(|at| Vec3::from_column_slice(&f[at..at + 3]));
            Vec3::new(y.z - z.y, z.x - x.z, x.y - y.x) - q
        };
        fields.chunks(3 * DENSITIES).map(of).collect()
    }

    /// n × ∇_s φ of each panel, the potential at a vertex the mean of its panels by area: m/s.
    pub(super) fn vorticity(&self, phi: &[f64]) -> Vec<Vec3> {
        let (corners, vertices) = (self.panels.corners(), self.panels.vertices());
        let mut at_vertices = vec![(0.0, 0.0); vertices.len()];
        for ((corners, area), phi) in corners.iter().zip(&self.faces.areas).zip(phi) {
            for v in corners {
                let (sum, weight) = &mut at_vertices[*v as usize];
                *sum += area * phi;
                *weight += area;
            }
        }
        let of = |(corners, area): (&[u32; 3], &f64)| {
            let [a, b, c] = corners.map(|v| vertices[v as usize]);
            let [fa, fb, fc] =
                corners.map(|v| at_vertices[v as usize].0 / at_vertices[v as usize].1);
            // n × ∇φ of a linear function: each corner's share goes against the opposite edge.
            -(fa * (c - b) + fb * (a - c) + fc * (b - a)) / (2.0 * area)
        };
        corners.iter().zip(&self.faces.areas).map(of).collect()
    }
}

/// The transpose of a body's vorticity: the cotangents of the potentials of the panels.
pub(super) fn sheet_bar(body: &PanelBoundary, bar: &[Vec3]) -> Vec<f64> {
    let (corners, vertices) = (body.panels.corners(), body.panels.vertices());
    let mut at_vertices = vec![(0.0, 0.0); vertices.len()];
    for ((corners, area), bar) in corners.iter().zip(&body.faces.areas).zip(bar) {
        let [a, b, c] = corners.map(|v| vertices[v as usize]);
        let opposite = [c - b, a - c, b - a];
        for (v, edge) in corners.iter().zip(opposite) {
            let (sum, weight) = &mut at_vertices[*v as usize];
            *sum -= edge.dot(bar) / (2.0 * area);
            *weight += area;
        }
    }
    let mean = |v: &u32| at_vertices[*v as usize].0 / at_vertices[*v as usize].1;
    let each = corners.iter().zip(&body.faces.areas);
    each.map(|(corners, area)| area * corners.iter().map(mean).sum::<f64>())
        .collect()
}
