//! The seam between the coupled system and what computes it.
//!
//! In the notation of the [fidelity](super): for k columns of body-frame twists x̄ a backend solves for
//! a, λ, r, μ and keeps them where it likes; what leaves it is small (momenta, energies, wrenches), but
//! for [`CoupledResponse::densities`].

use crate::Result;
use crate::adjoint::lie::Pose;
use crate::coupling::CoupledResponse;
use nalgebra::DMatrix;

/// What runs the pair work and the solves of the coupled system.
pub trait SystemBackend: Send + Sync {
    /// Name, for reports: `cpu`, or what the adapter calls itself.
    fn name(&self) -> &str;

    /// Solves for columns of body-frame twists (6·bodies × k, m/s and rad/s about the bodies' origins)
    /// at the given poses, one a body. Derivatives cost nothing until they are asked for.
    ///
    /// # Errors
    /// A solve that misses its tolerance, or a device that fails.
    fn respond(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
    ) -> Result<Box<dyn CoupledResponse + '_>>;
}
