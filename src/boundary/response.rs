//! What the water around one body answers, whatever the method it is solved by.

use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3};
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
    fn asymmetry(&self) -> f64;

    /// Condition number of the system that was solved.
    fn condition(&self) -> f64;

    /// Estimated relative error of the added mass, where two resolutions tell one.
    fn error(&self) -> Option<f64> {
        None
    }

    /// What the user should know, each with the body's name and its numbers.
    fn warnings(&self) -> &[String];
}
