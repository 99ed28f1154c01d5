//! One body in unbounded fluid, offline and once per shape, by one of several methods.
//!
//! All speak of the same flow: velocity −∇φ, density 1, body frame, body twists `ν = (u, ω)` about the
//! body's origin. [`mfs`] is what the coupled system of all bodies is built from; [`panel`] needs no
//! sources inside and converges evenly, so that two meshes tell its error; [`exact`] answers for
//! spheres and ellipsoids by formula; [`Response`] is what any method must answer for a body to be
//! compressed.

pub mod exact;
pub mod mfs;
pub mod panel;

pub use exact::{EllipsoidSurface, ExactBoundary};
pub use mfs::{BodyBoundary, Depth, Method, MfsSettings, Readout, RowScaling, depth, readout};
pub(crate) use mfs::{solve_upper, solve_upper_transpose};
pub use panel::PanelBoundary;

use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
use crate::geometry::Faces;
use faer::Mat;

/// A body alone in the water: its added mass, and the flow it makes when it moves or when it is held
/// fixed in the flow of others. Body frame, density 1, velocity −∇φ.
pub trait Response: Send + Sync {
    /// Added mass about the body's origin, symmetric: m³, m⁴, m⁵.
    fn added_mass(&self) -> Mat6;

    /// Potentials at `points` (outside the body) of the flow that the six unit twists make:
    /// points × 6, m²/s.
    ///
    /// # Errors
    /// What the method can't resolve.
    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>>;

    /// Potentials at `points` of the flow that the body, held fixed, adds to that of a unit source
    /// `1/|x − y|` at each of `sources` (all outside the body): points × sources, 1/m. Symmetric for
    /// equal points and sources up to the method's error (reciprocity).
    ///
    /// # Errors
    /// What the method can't resolve.
    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>>;

    /// max |M_ij − M_ji| / √(M_ii M_jj) before symmetrising; 0 for methods that are symmetric.
    fn asymmetry(&self) -> f64 {
        0.0
    }

    /// How often the edges of the body's faces were halved for it.
    fn halved(&self) -> usize {
        0
    }

    /// Estimated relative error of the added mass, where two resolutions tell one.
    fn error(&self) -> Option<f64> {
        None
    }

    /// What the user should know, each with the body's name and its numbers.
    fn warnings(&self) -> &[String];
}

/// `1/|x_i − s_j|`, points × sources.
fn potentials(points: &[Vec3], sources: &[Vec3]) -> Mat<f64> {
    Mat::from_fn(points.len(), sources.len(), |i, j| {
        1.0 / (points[i] - sources[j]).norm()
    })
}

/// max |M − Mᵀ|_ij / √(M_ii M_jj), by [`scaled`].
fn asymmetry(m: &Mat6, faces: &Faces) -> f64 {
    scaled(&(m - m.transpose()), m, faces)
}

/// max |D_ij| / √(M_ii M_jj). A diagonal entry under a hundredth of the displaced fluid's own
/// inertia (a sphere's rotation) counts as that hundredth.
fn scaled(difference: &Mat6, m: &Mat6, faces: &Faces) -> f64 {
    let area = faces.area();
    let pairs = || faces.centres.iter().zip(&faces.areas);
    let middle = pairs().map(|(c, a)| c * *a).sum::<Vec3>() / area;
    let spread = pairs()
        .map(|(c, a)| (c - middle).norm_squared() * a)
        .sum::<f64>()
        / area;
    let volume = faces.volume();
    let diagonal = |i: usize| {
        let displaced = if i < 3 { volume } else { volume * spread };
        m[(i, i)].max(0.01 * displaced)
    };
    let part = |i, j| difference[(i, j)].abs() / (diagonal(i) * diagonal(j)).sqrt();
    Mat6::from_fn(part).iter().copied().fold(0.0, f64::max)
}
