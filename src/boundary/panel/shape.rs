//! How the added mass changes with the vertices of the mesh: exactly, of the discrete sums.
//!
//! With the fluxes f = A q of the unit twists and adjoint densities λ,
//!
//! ```text
//! M = sym (f_xᵀ φ_y),   (½I + K) φ = S q,   (½I + K)ᵀ λ = f,   K = Ω/4π
//! ∂(f_xᵀ φ_y) = ∂f_xᵀ φ_y + λ_xᵀ (∂S q_y + S ∂q_y − ∂K φ_y)
//! ```
//!
//! A vertex moves the corners of its panels, and with their centroids the points at which layers are seen, their normals and their areas. The sums over points at the
//! corners of a panel are kept for each λ_x, and meet q_y and φ_y afterwards: all pairs of twists cost one sweep.

use super::PanelBoundary;
use crate::adjoint::kernel::{CornerSums, Form, Sources, corner_vjp, layers_vjp};
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use faer::Mat;
use rayon::prelude::*;

/// Entries of a symmetric 6 × 6 matrix.
const ENTRIES: usize = 21;

/// ∂M of the added mass at unit density (body frame, about its origin) with the position of each vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct MassSlopes {
    /// Of each vertex and coordinate: entries on and above the diagonal, by rows. kg/m, kg, kg·m.
    vertices: Vec<[[f64; ENTRIES]; 3]>,
}

impl MassSlopes {
    /// Rate of the added mass while the vertices move with these velocities (m/s, body frame): kg/s, kg·m/s, kg·m²/s.
    ///
    /// Panics unless there is one for each vertex.
    pub fn along(&self, velocities: &[Vec3]) -> Mat6 {
        assert_eq!(velocities.len(), self.vertices.len(), "one a vertex");
        let mut sum = [0.0; ENTRIES];
        for (slopes, v) in self.vertices.iter().zip(velocities) {
            for (slope, v) in slopes.iter().zip(v.iter()) {
                sum.iter_mut().zip(slope).for_each(|(s, x)| *s += v * x);
            }
        }
        let mut out = Mat6::zeros();
        for ((i, j), x) in entries().zip(sum) {
            (out[(i, j)], out[(j, i)]) = (x, x);
        }
        out
    }

    /// Its transpose: the gradient of `Σ bar_ij M_ij` with the vertices' positions, 1/m for numbers `bar` that make the sum one without a unit.
    pub fn pull_back(&self, bar: &Mat6) -> Vec<Vec3> {
        let weight = |(i, j): (usize, usize)| match i == j {
            true => bar[(i, i)],
            false => bar[(i, j)] + bar[(j, i)],
        };
        let weights: Vec<f64> = entries().map(weight).collect();
        let dot = |slope: &[f64; ENTRIES]| slope.iter().zip(&weights).map(|(s, w)| s * w).sum();
        let of = |slopes: &[[f64; ENTRIES]; 3]| Vec3::from_fn(|c, _| dot(&slopes[c]));
        self.vertices.iter().map(of).collect()
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }
}

/// Rows and columns on and above the diagonal.
fn entries() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

impl PanelBoundary {
    /// ∂M of [`PanelBoundary::added_mass`] with the vertices of its mesh, of what is computed, discretisation included.
    pub fn added_mass_slopes(&self) -> MassSlopes {
        let n = self.faces.len();
        let mut adjoint = Mat::from_fn(n, 6, |i, k| self.faces.twist_flux(i)[k]);
        self.lu.solve_transpose(adjoint.as_mut());
        let by_rows = |m: &Mat<f64>, sign: f64| -> Vec<f64> {
            (0..6 * n).map(|at| sign * m[(at / 6, at % 6)]).collect()
        };
        let lambda = by_rows(&adjoint, 1.0);
        let (triangles, points) = (self.panels.triangles(), Sources::new(&self.faces.centres));
        let mut sums = vec![CornerSums::default(); 6 * n];
        corner_vjp(triangles, &points, Form::Closed, &lambda, 6, &mut sums);
        let (q, turned) = (
            by_rows(&self.normal_velocity, 1.0),
            by_rows(&self.potential, -1.0),
        );
        let mut fields = vec![0.0; 18 * n];
        layers_vjp(triangles, &points, &q, &turned, 6, &mut fields);
        let of_face = |i: usize| {
            let row = |x: &[f64]| Vec6::from_column_slice(&x[6 * i..6 * i + 6]);
            let given = Given {
                q: row(&q),
                phi: -row(&turned),
                lambda: row(&lambda),
                sums: &sums[6 * i..6 * i + 6],
                fields: &fields[18 * i..18 * i + 18],
            };
            self.face_slopes(i, &given)
        };
        let corners: Vec<[[[f64; ENTRIES]; 3]; 3]> = (0..n).into_par_iter().map(of_face).collect();
        let mut vertices = vec![[[0.0; ENTRIES]; 3]; self.panels.vertices().len()];
        for (slopes, at) in corners.iter().zip(self.panels.corners()) {
            for (slopes, v) in slopes.iter().zip(at) {
                let out = vertices[*v as usize].iter_mut().flatten();
                out.zip(slopes.iter().flatten()).for_each(|(o, s)| *o += s);
            }
        }
        MassSlopes { vertices }
    }

    /// Of the corners of one face.
    fn face_slopes(&self, i: usize, given: &Given) -> [[[f64; ENTRIES]; 3]; 3] {
        let area = self.faces.areas[i];
        let areas = self.faces.area_slopes(i);
        // ∂f of the unit twists.
        let fluxes = [0, 1, 2, 3, 4, 5].map(|k| {
            let unit = Vec6::from_fn(|c, _| f64::from(c == k));
            self.faces.twist_flux_slopes(i, &unit)
        });
        let single = Vec6::from_fn(|x, _| given.sums[x].single);
        let mut out = [[[0.0; ENTRIES]; 3]; 3];
        for (k, out) in out.iter_mut().enumerate() {
            for (c, out) in out.iter_mut().enumerate() {
                let flux = Vec6::from_fn(|x, _| fluxes[x][k][c]);
                let velocity = (flux - given.q * areas[k][c]) / area;
                let seen = Vec6::from_fn(|x, _| given.sums[x].single_corners[k][c]);
                let turned = Vec6::from_fn(|x, _| given.sums[x].double_corners[k][c]);
                let field = Vec6::from_fn(|y, _| given.fields[3 * y + c] / 3.0);
                let raw = (flux - turned) * given.phi.transpose()
                    + seen * given.q.transpose()
                    + single * velocity.transpose()
                    + given.lambda * field.transpose();
                for ((i, j), out) in entries().zip(out) {
                    *out = 0.5 * (raw[(i, j)] + raw[(j, i)]);
                }
            }
        }
        out
    }
}

/// What is known of one face, for the six unit twists.
struct Given<'a> {
    q: Vec6,
    phi: Vec6,
    lambda: Vec6,
    /// Of λ.
    sums: &'a [CornerSums],
    /// ∇(S q − K φ) at the centroid, `[twist][3]`.
    fields: &'a [f64],
}
