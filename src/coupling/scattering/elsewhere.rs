//! The sums made elsewhere than here: on a device, over all pairs of points, without levels.

use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};

/// Coulomb sums of the points of compressed bodies. Charges and potentials are those of all points, body by body; images of walls are seen as the bodies' own.
pub trait Summing: Send + Sync {
    /// The bodies at these poses.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    fn place(&self, poses: &[Pose]) -> Result<Box<dyn SummingAt>>;
}

/// [`Summing`] at some poses.
pub trait SummingAt: Send + Sync {
    /// G α.
    ///
    /// # Errors
    /// A device that fails.
    fn potentials(&self, charges: &[f64]) -> Result<Vec<f64>>;

    /// The gradient of ½ αᵀ G α with the bodies' places, as spatial wrenches.
    ///
    /// # Errors
    /// A device that fails.
    fn gradient(&self, charges: &[f64]) -> Result<Vec<Vec6>>;

    /// δG α as the bodies are displaced by spatial twists.
    ///
    /// # Errors
    /// A device that fails.
    fn potentials_jvp(&self, z: &[Vec6], charges: &[f64]) -> Result<Vec<f64>>;

    /// How G α changes as bodies are displaced and charges change, the gradient, and how that does.
    ///
    /// # Errors
    /// A device that fails.
    fn gradient_jvp(&self, z: &[Vec6], charges: &[f64], rates: &[f64]) -> Result<Changed>;
}

/// What changes as bodies are displaced.
pub struct Changed {
    /// δ(G α).
    pub potentials: Vec<f64>,
    /// The gradient of ½ αᵀ G α, spatial wrenches.
    pub gradient: Vec<Vec6>,
    /// And its rate.
    pub rate: Vec<Vec6>,
}
