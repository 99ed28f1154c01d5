//! The seam between the coupled system and what computes it.
//!
//! In the notation of the [fidelity](super): for k columns of body-frame twists x̄ a backend solves for
//! a, λ, r, μ and keeps them where it likes; what leaves it is small (momenta, energies, wrenches), but
//! for [`SystemResponse::strengths`].

use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::{Direction, PairTensor, Tangent};
use crate::solver::Columns;
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
    ) -> Result<Box<dyn SystemResponse + '_>>;
}

/// The water's solution to k columns of twists at given poses: a, λ, r, μ, wherever they lie.
///
/// Bodies that none of the columns given to [`SystemBackend::respond`] moves have no impulses, there and in
/// all that comes from it by [`SystemResponse::directions`].
pub trait SystemResponse: Send + Sync {
    /// What its solves reached.
    fn reached(&self) -> Reached;

    /// M̄ x̄ of every column, ½ {B₆ᵀ P a + F₆ᵀ μ}: body-frame impulses at unit density, 6·bodies × k
    /// (m⁴/s and m⁵/s).
    ///
    /// # Errors
    /// A device that fails.
    fn momenta(&self) -> Result<DMatrix<f64>>;

    /// gᵀ a with g = Pᵀ B x̄, k × k (m⁵/s²), not symmetrised: E up to the error of discretisation that
    /// its asymmetry shows.
    ///
    /// # Errors
    /// A device that fails.
    fn energies(&self) -> Result<DMatrix<f64>>;

    /// ∇_g E of all pairs of columns, ½ [ B_xᵀ δP a_y − μ_xᵀ δK a_y + r_xᵀ δK λ_y ] + (x ↔ y):
    /// spatial wrenches on each body.
    ///
    /// # Errors
    /// A device that fails.
    fn gradient(&self) -> Result<PairTensor>;

    /// The solution to these directions, one column each: [`Direction::Basis`] a combination of the
    /// columns there are, [`Direction::Twist`] a further solve.
    ///
    /// # Errors
    /// A solve that misses its tolerance, or a device that fails.
    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn SystemResponse + '_>>;

    /// The tangent of the energy of the first with the last column (which are one if there is one)
    /// along the displacement z, a spatial twist a body.
    ///
    /// # Errors
    /// Neither one column nor two, a solve that misses its tolerance, or a device that fails.
    fn tangent(&self, z: &[Vec6]) -> Result<Tangent>;

    /// Strengths a, sources × k, on the host.
    ///
    /// # Errors
    /// A device that fails.
    fn strengths(&self) -> Result<Columns>;
}

/// What solves reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reached {
    /// Iterations of the slowest column; 0 for direct solves.
    pub iterations: usize,
    /// Largest relative residual of the normal equations.
    pub residual: f64,
}

impl Reached {
    /// The worse of both.
    pub fn worst(self, other: Self) -> Self {
        Self {
            iterations: self.iterations.max(other.iterations),
            residual: self.residual.max(other.residual),
        }
    }
}
