//! One body in unbounded fluid by a direct boundary element method with constant panels.
//!
//! Green's third identity for the flow outside, velocity −∇φ, q = −∂φ/∂n the normal velocity into
//! the fluid, collocated at the panels' centroids:
//!
//! ```text
//! φ(x) = Σ_j S_j(x) q_j − Ω_j(x)/4π φ_j                      x in the fluid
//! (½ I + Ω/4π) φ = S q                                     on the body
//! S_j(x) = 1/4π ∫_j 1/|x − y| dA,  Ω_j(x) = ∫_j n·(y − x)/|y − x|³ dA,  Ω_ii = 0
//! M = sym(Σ_i A_i q_i φ_iᵀ)                                for the six unit twists
//! ```
//!
//! There is no depth to choose, the condition number stays small (a constant potential answers
//! itself, since the solid angles of a closed surface add up to 2π on it), and the error falls with
//! the square of the edge length (with its power 4/3 at sharp edges), so that two meshes give a better
//! value and an estimate: see [`richardson`](fn@richardson).
//!
//! # References
//! J. L. Hess, A. M. O. Smith, Prog. Aerosp. Sci. 8 (1967) 1–138 (panels); L. Morino, C.-C. Kuo, AIAA
//! J. 12 (1974) 191–197 (the direct form).

mod gradient;
mod hadamard;
mod layers;
pub mod richardson;
mod richardson_slopes;
mod sensed;
mod shape;
mod sheet;

use super::{Response, asymmetry, potentials};
use crate::adjoint::kernel::Write;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use crate::geometry::{Faces, TriMesh};
use crate::memory;
use crate::once::once;
use crate::solver::{Columns, Lu, product, transposed_product};
use crate::{Error, Result};
use faer::{Mat, MatRef};
pub(crate) use layers::Panels;
pub use richardson::{Extrapolated, Richardson, richardson};
pub use richardson_slopes::RichardsonSlopes;
pub use shape::MassSlopes;
use std::sync::OnceLock;

/// Most faces of one system: its matrix takes 8·faces² bytes, 3.2 GB here.
pub const MOST_FACES: usize = 20_000;
/// Turn of the surface, rad, from which an edge is sharp.
const SHARP: f64 = 0.96;
/// Thickness in edges under which motions along a plate aren't resolved: a disc's added mass edgewise is 4 % off at 0.057, 66 % at 0.027.
const THIN: f64 = 0.05;
/// Condition number above which results lose digits that matter.
const ILL_CONDITIONED: f64 = 1e6;

/// One body's panels: constant in the body frame, for density 1, immutable. Equal shapes may share
/// one (`Arc`).
#[derive(Clone, Debug)]
pub struct PanelBoundary {
    /// Name, for messages.
    pub name: String,
    /// Geometry of the panels.
    pub faces: Faces,
    /// Added mass about the body's origin, symmetric, for density 1: kg, kg·m, kg·m².
    pub added_mass: Mat6,
    /// max |M − Mᵀ|_ij / √(M_ii M_jj) before symmetrising: a free estimate of the error.
    pub asymmetry: f64,
    /// Condition number of ½I + Ω/4π (estimated from below).
    pub condition: f64,
    /// What the user should know, each with the body's name and its numbers.
    pub warnings: Vec<String>,
    /// Length of the edges at which the normal turns by more than 55°, m.
    sharp_edges: f64,
    panels: Panels,
    lu: Lu,
    /// Inverse of ½I + Ω/4π, column-major: made when a coupled system first asks for it.
    inverse: OnceLock<Vec<f64>>,
    /// What differences of potentials make of the surface gradient: made when first asked for.
    slopes: OnceLock<gradient::Slopes>,
    /// q, normal velocity of each panel per unit twist, panels × 6.
    normal_velocity: Mat<f64>,
    /// φ, potential of each panel per unit twist, panels × 6.
    potential: Mat<f64>,
    /// S q, single layer of the normal velocities at the centroids per unit twist, panels × 6.
    single_layer: Mat<f64>,
}

impl PanelBoundary {
    /// Solves for the body `name` with a mesh in its frame.
    ///
    /// # Errors
    /// More than [`MOST_FACES`] faces, and a mesh too coarse to resolve the body.
    pub fn new(name: &str, mesh: &TriMesh) -> Result<Self> {
        check_size(&format!("body \"{name}\""), mesh.faces().len())?;
        let faces = Faces::of(mesh);
        let panels = Panels::new(mesh, &faces);
        let n = faces.len();
        let mut matrix = vec![0.0; n * n];
        panels.double_layer(&faces.centres, Write::Set, &mut matrix, n, 0);
        for i in 0..n {
            matrix[i * n + i] = 0.5;
        }
        let lu = Lu::new(matrix, n);
        let normal_velocity = Mat::from_fn(n, 6, |i, k| faces.twist_flux(i)[k] / faces.areas[i]);
        let right = panels.potential(&faces.centres, Some(normal_velocity.as_ref()), None);
        let single_layer = Mat::from_fn(n, 6, |i, k| right[6 * i + k]);
        let mut potential = single_layer.clone();
        lu.solve(potential.as_mut());
        let mut raw = Mat6::zeros();
        for i in 0..n {
            let phi = Vec6::from_fn(|k, _| potential[(i, k)]);
            raw += faces.twist_flux(i) * phi.transpose();
        }
        let condition = lu.condition();
        let unresolved = |quantity: &str, value: f64, limit: f64| Error::Unresolved {
            place: format!("body \"{name}\""),
            quantity: quantity.into(),
            value,
            limit,
            remedy: format!("the mesh ({n} faces) is too coarse for it; use more faces"),
        };
        if !(condition.is_finite() && raw.iter().all(|x| x.is_finite())) {
            let quantity = "condition number of the panel matrix";
            return Err(unresolved(quantity, condition, ILL_CONDITIONED));
        }
        let added_mass = 0.5 * (raw + raw.transpose());
        let translation = added_mass.fixed_view::<3, 3>(0, 0).symmetric_eigenvalues();
        if translation.min() <= 0.0 {
            let quantity = "smallest added mass in translation, relative to the displaced";
            return Err(unresolved(
                quantity,
                translation.min() / faces.volume(),
                0.0,
            ));
        }
        let mut warnings = Vec::new();
        if condition > ILL_CONDITIONED {
            warnings.push(format!(
                "body \"{name}\": condition number {condition:.1e} of the panel matrix is above \
                 {ILL_CONDITIONED:.0e}; use more, and more even, faces"
            ));
        }
        warnings.extend(too_thin(name, &faces));
        Ok(Self {
            name: name.to_string(),
            asymmetry: asymmetry(&raw, &faces),
            added_mass,
            condition,
            warnings,
            sharp_edges: mesh.sharp_edge_length(SHARP),
            panels,
            lu,
            inverse: OnceLock::new(),
            slopes: OnceLock::new(),
            normal_velocity,
            potential,
            single_layer,
            faces,
        })
    }

    /// The panels as layers, body frame.
    pub(crate) fn panels(&self) -> &Panels {
        &self.panels
    }

    /// Normal velocities per unit twist, panels × 6.
    pub(crate) fn normal_velocity(&self) -> &Mat<f64> {
        &self.normal_velocity
    }

    /// Their single layer at the centroids, panels × 6.
    pub(crate) fn single_layer(&self) -> &Mat<f64> {
        &self.single_layer
    }

    /// Potentials of the panels for a twist of the body in water at rest, m²/s.
    pub(crate) fn own_potential(&self, twist: &Vec6) -> Vec<f64> {
        combined(&self.potential, twist)
    }

    /// Their normal velocities, m/s.
    pub(crate) fn own_normal_velocity(&self, twist: &Vec6) -> Vec<f64> {
        combined(&self.normal_velocity, twist)
    }

    /// Potential at points outside (body frame, m) of layers with these normal velocities `q` (m/s) and potentials `phi` (m²/s) of the panels.
    pub(crate) fn layers(&self, q: &[f64], phi: &[f64], points: &[Vec3]) -> Vec<f64> {
        let [q, phi] = [q, phi].map(|x| MatRef::from_column_major_slice(x, x.len(), 1));
        self.panels.potential(points, Some(q), Some(phi))
    }

    /// Total potentials of the panels, m²/s, for columns of the body's twists in flows with the potentials `incident` at the centroids
    /// (panels × columns): `(½I + Ω/4π) φ = S q + φ_incident`.
    pub(crate) fn total_potential(&self, twists: &[Vec6], incident: &Columns) -> Columns {
        let mut out = Mat::from_fn(incident.rows, incident.columns, |i, k| {
            let own = (0..6).map(|c| self.single_layer[(i, c)] * twists[k][c]);
            incident.at(i, k) + own.sum::<f64>()
        });
        self.lu.solve(out.as_mut());
        Columns::from_fn(incident.rows, incident.columns, |i, k| out[(i, k)])
    }

    /// The transpose of [`PanelBoundary::total_potential`] for two columns: cotangents of the twists and of the incident potentials.
    pub(crate) fn total_potential_vjp(&self, bar: &Columns) -> ([Vec6; 2], Columns) {
        let mut out = bar.as_mat().to_owned();
        self.lu.solve_transpose(out.as_mut());
        let twist = |k: usize| {
            let product = |i: usize, c: usize| self.single_layer[(i, c)] * out[(i, k)];
            Vec6::from_fn(|c, _| (0..bar.rows).map(|i| product(i, c)).sum())
        };
        let incident = Columns::from_fn(bar.rows, 2, |i, k| out[(i, k)]);
        ([twist(0), twist(1)], incident)
    }

    /// `(½I + Ω/4π)⁻¹`, column-major.
    pub(crate) fn inverse(&self) -> &[f64] {
        once(&self.inverse, || self.lu.inverse()).as_slice()
    }

    /// `(½I + Ω/4π)⁻¹ x`, or its transpose. By the inverse, as a product runs on all threads and triangular solves don't.
    pub(crate) fn solve(&self, x: &Columns, transpose: bool) -> Columns {
        let inverse = self.inverse();
        // The memory of a matrix by columns is that of its transpose by rows.
        match transpose {
            false => transposed_product(inverse, x.rows, x),
            true => product(inverse, x.rows, x),
        }
    }
}

/// Rows per unit twist, of a twist.
fn combined(rows: &Mat<f64>, twist: &Vec6) -> Vec<f64> {
    let of = |i: usize| (0..6).map(|k| rows[(i, k)] * twist[k]).sum();
    (0..rows.nrows()).map(of).collect()
}

/// Tells where a body is so thin for its faces that what moves along it, past its rim alone, isn't resolved.
fn too_thin(name: &str, faces: &Faces) -> Option<String> {
    let n = faces.len() as f64;
    // Of a plate with this volume and area, and of equilateral faces.
    let thickness = 2.0 * faces.volume() / faces.area();
    let edge = (4.0 / 3f64.sqrt() * faces.area() / n).sqrt();
    let part = thickness / edge;
    (part < THIN).then(|| {
        let needed = (n * (THIN / part).powi(2)).ceil();
        let remedy = match needed <= MOST_FACES as f64 {
            true => format!("{needed} faces resolve it"),
            false => format!("that would take {needed:.1e} faces: make it thicker"),
        };
        format!(
            "body \"{name}\": a thickness of {thickness:.2e} m is {part:.3} of its faces' edges: the added mass of motions along it, which is \
             small, may be off by more than a tenth; {remedy}"
        )
    })
}

/// Refuses systems whose matrix would not fit.
pub(crate) fn check_size(what: &str, faces: usize) -> Result<()> {
    if faces <= MOST_FACES {
        // The matrix, its factors and its inverse.
        return memory::fits(
            &format!("the panel method for {what} with {faces} faces"),
            memory::numbers(3.0 * (faces as f64).powi(2)),
            "use coarser meshes",
        );
    }
    let gigabytes = 8e-9 * (faces as f64).powi(2);
    Err(Error::Unsupported {
        what: format!("the panel method for {what} with {faces} faces"),
        why: format!(
            "its matrix would take {gigabytes:.1} GB; at most {MOST_FACES} faces (3.2 GB) are solved"
        ),
        instead:
            "use coarser meshes: 5000 faces are accurate to a few tenths of a percent on smooth \
             bodies, to 1–3 % with sharp edges"
                .into(),
    })
}

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
        let mut total = potentials(&self.faces.centres, sources);
        self.lu.solve(total.as_mut());
        let out = self.panels.potential(points, None, Some(total.as_ref()));
        Ok(MatRef::from_row_major_slice(&out, points.len(), sources.len()).to_owned())
    }

    fn asymmetry(&self) -> f64 {
        self.asymmetry
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}
