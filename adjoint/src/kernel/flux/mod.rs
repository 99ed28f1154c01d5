//! Flux of a point source through triangles, `w_i Ω_i(s)`.
//!
//! With `r_c = v_c − s` the corners seen from the source and `l_c = |r_c|`,
//!
//! ```text
//! tan(Ω/2) = N/D,  N = 2A n·r_0,  D = l_0 l_1 l_2 + (r_0·r_1) l_2 + (r_1·r_2) l_0 + (r_2·r_0) l_1,
//! ```
//!
//! positive for a source behind a triangle (inside a body, normals outward). Its gradient is a sum
//! over the directed edges `a → b` of the triangle, the field of a current along them:
//!
//! ```text
//! ∇_s Ω = Σ g_ab,  g_ab = c (r_a × (b − a)),  c = 2 S/(P Q),
//! S = l_a + l_b,  P = l_a l_b,  Q = S² − |b − a|² = 2 (P + r_a·r_b).
//! ```
//!
//! An edge serves its two faces with opposite signs, so sums over faces are sums over edges of
//! differences of face weights: half the work, and closed surfaces cancel exactly.
//!
//! # References
//! A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng.
//! 30 (1983) 125–126. The edge term is the Biot–Savart integral of a straight segment.

mod hvp;
mod jvp;
mod value;
mod vjp;

pub(super) use hvp::edge_gradient_tangent;
pub use hvp::{flux_hessian_product, flux_hvp};
pub use jvp::flux_jvp;
pub(super) use value::solid_angle;
#[cfg(test)]
pub(super) use value::solid_angle_of as value_of_corners;
pub use value::{flux, flux_fill};
pub(super) use vjp::edge_gradient;
pub use vjp::{flux_gradient, flux_vjp};

use super::lane::{Lane, V3};
use crate::lie::Vec3;

/// A constant vector as lanes.
#[inline(always)]
fn constant<T: Lane>(x: T, v: &Vec3) -> V3<T> {
    [x.like(v.x), x.like(v.y), x.like(v.z)]
}
