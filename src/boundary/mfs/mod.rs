//! One body in unbounded fluid by the method of fundamental solutions.
//!
//! Potential `φ(x) = Σ_j α_j / |x − s_j|`, fluid velocity `−∇φ`, density 1. Everything is in the body
//! frame and constant there. A body twist `ν = (u, ω)` is taken about the body's origin, m/s and
//! rad/s. With the rows of [`Method`],
//!
//! ```text
//! [K; D] α ≈ [F̄; 0] ν     least squares, D a slight damping    (the paper's Eq. 17, 20)
//! T = ½ Σ_i φ_i B̄_i ν      φ_i the potential's mean over face i, φ = P α
//! M = sym(B̄ᵀ P [K; D]⁺ F̄)   6 × 6 added mass (kg for density 1 kg/m³)
//! ```
//!
//! Between bodies φ_i is the potential at the face's centre, `P_ij = 1/|c_i − s_j|`; for a body's own
//! sources see [`readout`]. [`depth`] says where the sources are.
//!
//! # References
//! Fairweather & Karageorghis 1998 (MFS); Van Oosterom & Strackee 1983 (solid angle).

mod assemble;
pub mod depth;
mod factor;
pub mod readout;
mod settings;
mod sparse;

use super::{Response, asymmetry, potentials};
use crate::adjoint::kernel::{Points, Triangles};
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use crate::geometry::{Faces, Interior, TriMesh};
use crate::memory;
use crate::{Error, Result};
use faer::{Mat, MatMut, MatRef};

pub(crate) use factor::{solve_upper, solve_upper_transpose};
pub use settings::{Depth, Method, MfsSettings, Readout, RowScaling};

/// Condition number above which results lose digits that matter.
const ILL_CONDITIONED: f64 = 1e8;

/// One body's discretisation: constant in the body frame, for density 1, immutable. Equal shapes may
/// share one (`Arc`).
#[derive(Clone, Debug)]
pub struct BodyBoundary {
    /// Name, for messages.
    pub name: String,
    /// What it was made with.
    pub settings: MfsSettings,
    /// Geometry of the faces.
    pub faces: Faces,
    /// Source points s_j, m, body frame.
    pub sources: Vec<Vec3>,
    /// w_i: a row is w_i · flux ([`Method::MfsVertex`]) or w_i · normal velocity at the centre
    /// ([`Method::MfsFace`]).
    pub row_weights: Vec<f64>,
    /// The faces as targets of the flux kernel, with their row weights.
    pub triangles: Triangles,
    /// The faces' centres as targets of the normal and potential kernels, with their row weights.
    pub points: Points,
    /// F̄, faces × 6: the row that a unit twist asks for; `F_i(ν) = twist_rows[i] · ν`.
    pub twist_rows: Vec<Vec6>,
    /// B̄, faces × 6: flux that weighs the potential at each face's centre, m³/s. That of a unit twist
    /// ([`Faces::twist_flux`]), with [`Readout::Corrected`] plus the body's own residual flux.
    pub readout_flux: Vec<Vec6>,
    /// K, row-major faces × sources: the row that a unit source makes. See
    /// [`BodyBoundary::flux_matrix`].
    pub flux_rows: Vec<f64>,
    /// PᵀB̄ of the body's own faces and sources, sources × 6.
    pub readout: Vec<Vec6>,
    /// [K; D]⁺F̄, sources × 6: strengths that answer a unit twist of the body alone.
    pub strengths: Vec<Vec6>,
    /// Added mass about the body's origin, symmetric, for density 1: kg, kg·m, kg·m².
    pub added_mass: Mat6,
    /// max |M − Mᵀ|_ij / √(M_ii M_jj) before symmetrising: a free estimate of the error.
    pub asymmetry: f64,
    /// ‖F̄ν − Kα‖ / ‖F̄ν‖ for each unit twist; 0 where the twist moves no fluid.
    pub residual: Vec6,
    /// Condition number of [K; D] with columns scaled to unit length (estimated from below).
    pub condition: f64,
    /// What the user should know, each with the body's name and its numbers.
    pub warnings: Vec<String>,
    /// Diagonal of the damping rows D, length sources; zeros without damping. Strengths solve
    /// `min ‖Kα − F̄ν‖² + ‖Dα‖²`, so the normal equations are `(KᵀK + D²) α = KᵀF̄ν`.
    pub damping: Vec<f64>,
    /// R of the thin QR of [K; D], sources × sources.
    r: Mat<f64>,
}

impl BodyBoundary {
    /// Discretises the body `name` with a mesh in its frame.
    ///
    /// # Errors
    /// Settings out of range, and a mesh that doesn't resolve the body.
    pub fn new(name: &str, mesh: &TriMesh, settings: &MfsSettings) -> Result<Self> {
        let mut out = Self::lay_out(name, mesh, settings)?;
        let (faces, sources) = (out.faces.len() as f64, out.sources.len() as f64);
        // The matrix, with its damping as it is factored, and the factor.
        let numbers = faces * sources + 2.0 * (faces + sources) * sources + sources * sources;
        memory::fits(
            &format!("solving body \"{name}\" with {faces} faces by fundamental solutions"),
            memory::numbers(numbers),
            "use fewer faces, or the fidelity reduced with a coarser mesh",
        )?;
        out.solve_alone()?;
        Ok(out)
    }

    /// As [`BodyBoundary::new`] for bodies of too many faces to factor: nothing of the size of a matrix
    /// is made. What a solve of the body alone gives is missing: K, strengths, the factor and the added mass
    /// are empty or zero, its flow ([`Response`]) isn't told, and the potential is read out without the own
    /// residual flux ([`Readout`]'s centre flux). For backends that need no matrix.
    ///
    /// # Errors
    /// As [`BodyBoundary::new`].
    pub fn unfactored(name: &str, mesh: &TriMesh, settings: &MfsSettings) -> Result<Self> {
        let mut out = Self::lay_out(name, mesh, settings)?;
        if settings.damping > 0.0 {
            let norms = out.column_norms();
            out.damping = norms.iter().map(|n| settings.damping * n).collect();
        }
        let rule = readout::points(&out.faces, &out.sources, settings.readout);
        out.readout = readout::own(&rule, &out.sources, &out.readout_flux);
        out.warnings.push(format!(
            "body \"{name}\": its {} faces are solved without a factor of its own: more iterations, and the \
             potential is read out to first order in what its rows leave",
            out.faces.len()
        ));
        Ok(out)
    }

    /// All that needs no solve; no damping yet.
    fn lay_out(name: &str, mesh: &TriMesh, settings: &MfsSettings) -> Result<Self> {
        let surface = Interior::new(mesh);
        let (sources, warnings) = depth::place(name, &surface, settings.method, settings.depth)?;
        let damping = settings.damping;
        if !(damping.is_finite() && damping >= 0.0) {
            return Err(Error::input(
                format!("body \"{name}\": damping"),
                damping,
                "0 for none, or a small positive number such as 0.003",
            ));
        }
        let faces = surface.faces;
        let method = settings.method;
        let row_weights = assemble::row_weights(&faces, method, settings.rows);
        Ok(Self {
            name: name.to_string(),
            settings: *settings,
            twist_rows: assemble::twist_rows(&faces, method, &row_weights),
            triangles: Triangles::new(mesh.vertices(), mesh.faces(), row_weights.clone()),
            points: Points::new(&faces.centres, &faces.normals, row_weights.clone()),
            readout_flux: (0..faces.len()).map(|i| faces.twist_flux(i)).collect(),
            damping: vec![0.0; sources.len()],
            row_weights,
            sources,
            warnings,
            faces,
            flux_rows: Vec::new(),
            readout: Vec::new(),
            strengths: Vec::new(),
            added_mass: Mat6::zeros(),
            asymmetry: 0.0,
            residual: Vec6::zeros(),
            condition: 0.0,
            r: Mat::new(),
        })
    }

    /// The body alone in the water: its factor, strengths and added mass.
    fn solve_alone(&mut self) -> Result<()> {
        self.flux_rows = self.rows_of(&self.sources);
        let (name, faces, sources) = (&self.name, &self.faces, &self.sources);
        let k = MatRef::from_row_major_slice(&self.flux_rows, faces.len(), sources.len());
        let rhs = Mat::from_fn(faces.len(), 6, |i, j| self.twist_rows[i][j]);
        let factored = factor::solve(k, rhs.as_ref(), self.settings.damping);
        let alpha = &factored.solution;
        let strengths: Vec<Vec6> = (0..sources.len())
            .map(|i| Vec6::from_fn(|j, _| alpha[(i, j)]))
            .collect();

        let left = &rhs - k * alpha;
        let largest = (0..6).map(|j| rhs.col(j).norm_l2()).fold(0.0, f64::max);
        let residual = Vec6::from_fn(|j, _| {
            let asked = rhs.col(j).norm_l2();
            // A twist that moves no fluid asks for round-off only.
            if asked > 1e-12 * largest {
                left.col(j).norm_l2() / asked
            } else {
                0.0
            }
        });
        let readout_flux: Vec<Vec6> = match self.settings.readout {
            Readout::Centre => self.readout_flux.clone(),
            Readout::Corrected => (0..faces.len())
                .map(|i| {
                    let per_row = match self.settings.method {
                        Method::MfsVertex => 1.0 / self.row_weights[i],
                        Method::MfsFace => faces.areas[i] / self.row_weights[i],
                    };
                    self.readout_flux[i] + Vec6::from_fn(|j, _| left[(i, j)] * per_row)
                })
                .collect(),
        };
        let rule = readout::points(faces, sources, self.settings.readout);
        let readout = readout::own(&rule, sources, &readout_flux);
        let mut raw = Mat6::zeros();
        for (p, a) in readout.iter().zip(&strengths) {
            raw += p * a.transpose();
        }
        if !raw.iter().all(|x| x.is_finite()) {
            return Err(Error::Unresolved {
                place: format!("body \"{name}\""),
                quantity: "condition number of the flux matrix".into(),
                value: factored.condition,
                limit: ILL_CONDITIONED,
                remedy: "use a smaller or automatic source depth".into(),
            });
        }
        let added_mass = 0.5 * (raw + raw.transpose());
        let translation = added_mass.fixed_view::<3, 3>(0, 0).symmetric_eigenvalues();
        if translation.min() <= 0.0 {
            return Err(Error::Unresolved {
                place: format!("body \"{name}\""),
                quantity: "smallest added mass in translation, relative to the displaced".into(),
                value: translation.min() / faces.volume(),
                limit: 0.0,
                remedy: format!("the mesh ({} faces) is too coarse for it", faces.len()),
            });
        }
        if factored.condition > ILL_CONDITIONED {
            self.warnings.push(format!(
                "body \"{name}\": condition number {:.1e} of the flux matrix is above {ILL_CONDITIONED:.0e}{}; \
                 use a smaller or automatic source depth, or a more even mesh",
                factored.condition,
                if factored.singular { " (solved with damping 1e-10)" } else { "" }
            ));
        }
        self.asymmetry = asymmetry(&raw, faces);
        self.condition = factored.condition;
        self.damping = factored.damping;
        self.r = factored.r;
        self.strengths = strengths;
        self.residual = residual;
        self.readout_flux = readout_flux;
        self.readout = readout;
        self.added_mass = added_mass;
        Ok(())
    }

    /// K, faces × sources.
    pub fn flux_matrix(&self) -> MatRef<'_, f64> {
        MatRef::from_row_major_slice(&self.flux_rows, self.faces.len(), self.sources.len())
    }

    /// R of the thin QR `[K; D] = Q R`, D the diagonal [`BodyBoundary::damping`]: upper triangular,
    /// sources × sources. `RᵀR = KᵀK + D²`; `[K; D] R⁻¹` has orthonormal columns.
    pub fn factor(&self) -> MatRef<'_, f64> {
        self.r.as_ref()
    }

    /// Whether it has a factor.
    pub fn factored(&self) -> bool {
        self.r.ncols() == self.sources.len()
    }

    /// Refuses to tell the flow of a body that was never solved alone.
    fn check_factored(&self, flow: &str) -> Result<()> {
        if self.factored() {
            return Ok(());
        }
        Err(Error::Unsupported {
            what: format!(
                "the flow {flow} by body \"{}\" with {} faces",
                self.name,
                self.faces.len()
            ),
            why: "it was made without a factor".into(),
            instead: "make it by BodyBoundary::new, of fewer faces if it doesn't fit".into(),
        })
    }

    /// `x ← R⁻¹ x`, x sources × columns.
    pub fn solve_factor(&self, x: MatMut<'_, f64>) {
        factor::solve_upper(self.r.as_ref(), x);
    }

    /// `x ← R⁻ᵀ x`, x sources × columns.
    pub fn solve_factor_transpose(&self, x: MatMut<'_, f64>) {
        factor::solve_upper_transpose(self.r.as_ref(), x);
    }
}

impl Response for BodyBoundary {
    fn added_mass(&self) -> Mat6 {
        self.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        self.check_factored("radiated")?;
        let alpha = Mat::from_fn(self.sources.len(), 6, |j, k| self.strengths[j][k]);
        Ok(potentials(points, &self.sources) * alpha)
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        self.check_factored("scattered")?;
        let rows = self.rows_of(sources);
        let rows = MatRef::from_row_major_slice(&rows, self.faces.len(), sources.len());
        // (KᵀK + D²) α = −Kᵀ k(y)
        let mut alpha = -(self.flux_matrix().transpose() * rows);
        self.solve_factor_transpose(alpha.as_mut());
        self.solve_factor(alpha.as_mut());
        Ok(potentials(points, &self.sources) * alpha)
    }

    fn asymmetry(&self) -> f64 {
        self.asymmetry
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}
