//! Bearings: two surfaces with viscous water between them, whose squeezing out resists their motion (Reynolds' lubrication).
//!
//! In a gap that is thin against the surfaces, and in which viscosity rules over inertia, the pressure p balances the shear across the gap. With the
//! thickness H, the velocity u of one surface against the other, and the mean m of both normals, ½(n_b − n_a),
//!
//! ```text
//! div(H³/12μ ∇p) = −m·u,   p = 0 in the open        W = −C(q) V,   C = μ (bᵀ A⁻¹ b + S),   V the one's twist against the other's
//! A_ij = ∫ H³/12 ∇φ_i·∇φ_j dA     b_i = ∫ φ_i (m, x × m) dA     Vᵀ S V = ∫ |u − g g·u|²/H dA
//! δ(zᵀ b ᵀA⁻¹ b y) = −ψ_zᵀ δA ψ_y + ψ_zᵀ δb y + ψ_yᵀ δb z       ψ = A⁻¹ b: no adjoint solve
//! ```
//!
//! The load is Reynolds' whole one: in the frame of either surface it is the normal velocity of the other and half the flow that the surface drags along,
//! ½ div(H u); the mean over both frames leaves m·u, in which sliding along a wedge counts by its slope. So is C symmetric, and the force along the
//! surfaces has the part that the pressure's own flow exerts there. S is Couette's shear. C acts on the relative twist alone and is positive
//! semi-definite: what it takes from one body it gives to the other, and it never makes energy.
//!
//! Surfaces touch at the tips of their roughness r: H = d + r at the distance d, and where they overlap H falls to r/2 (`thickness`), so that C is
//! finite at contact.
//!
//! It is solved by elements on one body's own surface that follow 1/H² (`element`), whose faces are cut smaller, on the exact shape where there is one, until
//! the thickness changes by a factor of about three within any (`patch`): a ball over a wall at a gap of a thousandth of its radius presses on a spot far smaller than a face. How faces are cut
//! is a decision of the pose: derivatives keep it, and C jumps where it changes by what the discretisation is off there, which no
//! energy comes from.
//!
//! # References
//! O. Reynolds, "On the theory of lubrication", Phil. Trans. R. Soc. 177, 1886. B. Hamrock, S. Schmid, B. Jacobson, "Fundamentals of Fluid Film
//! Lubrication", 2004.

mod element;
mod flow;
mod near;
mod patch;
mod pull;
mod surface;
mod thickness;

pub use flow::{PlacedBearing, Unsolved};
pub(crate) use near::NearBearings;
pub(crate) use surface::BearingSurface;

use crate::adjoint::lie::Pose;
use crate::geometry::Opposite;
use std::sync::Arc;

/// Two surfaces that may have viscous water between them.
#[derive(Clone)]
pub struct Bearing {
    /// The one on whose faces it is solved, in its own frame.
    pub(crate) surface: Arc<BearingSurface>,
    /// What is opposite, in its own frame: that of a body, or of the world for a wall.
    pub(crate) opposite: Arc<Opposite>,
    /// Distance at which the pressure has fallen to that in the open, m.
    pub(crate) reach: f64,
}

impl Bearing {
    /// At a pose of the first in the frame of the other, with surfaces of this roughness (m, above zero), at unit viscosity; `None` where they are farther apart
    /// than the water between them reaches.
    ///
    /// # Errors
    /// A pressure that isn't found.
    pub fn placed(
        &self,
        relative: &Pose,
        roughness: f64,
    ) -> Result<Option<PlacedBearing>, Unsolved> {
        PlacedBearing::new(self, relative, roughness)
    }
}
