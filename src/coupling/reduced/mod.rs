//! Multiple scattering between a few sources a body: the solution of each body to the water is computed
//! once per shape ([`compress`]); what remains at run time are Coulomb sums and a small dense system.
//!
//! With all points x of all bodies, `G_ij = 1/|x_i − x_j|` between points of different bodies (with
//! walls also the images of all points, of the same body too), body-frame twists x̄, and per body
//! `S̄ = L Lᵀ`, all at unit density:
//!
//! ```text
//! α = Ū x̄ + L a,        (I − LᵀG L) a = LᵀG Ū x̄        (α = (I − S̄G)⁻¹ Ū x̄)
//! M̄ x̄ = M̄₀ x̄ + 4π Ūᵀ G α                               symmetric by construction
//! δE(x, y) = 4π α_xᵀ δG α_y                             a Coulomb energy: no adjoint solve
//! δα = L δa,            (I − LᵀG L) δa = Lᵀ δG α
//! δ²E(x, y) = 4π [ α_xᵀ δδG α_y + δα_xᵀ δG α_y + α_xᵀ δG δα_y ]
//! ```
//!
//! `I − LᵀGL` is symmetric, and positive definite while the bodies are apart: a Cholesky
//! factorisation that fails tells of a gap that the sources don't resolve.

mod body;
pub mod cache;
mod check;
pub mod compress;
mod cutoff;
mod linearised;
mod link;
mod resolved;
mod second;
mod system;
mod views;

pub use body::{CompressedParts, Fit, ReducedBody};
pub use cutoff::Cutoff;
pub use link::Link;
pub use system::Reduced;
