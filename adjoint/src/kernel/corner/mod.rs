//! Derivatives of panels' layers with respect to the corners of their triangles.
//!
//! A triangle whose corners move keeps its points at the same shares λ_k of them, so that with n its normal, m_e the outward normals
//! of its edges in its plane, r_c = v_c − s, h = n·r, s' the projection of s and L_e, Ω as in [`single`](mod@super::single) and
//! [`flux`](mod@super::flux),
//!
//! ```text
//! I = ∫ 1/r dA        ∂I/∂v_k = n {−λ_k(s') Ω + h ∇λ_k·Σ_e m_e L_e} + Σ_{e ∋ k} m_e ∫_e λ_k/r dl
//!                     ∫_e λ_b/r dl = ((l_b − l_a) − L_e r_a·e/|e|)/|e|,   ∫_e λ_a/r dl = L_e − that       e from a to b
//! Ω = ∫ n·r/r³ dA     ∂Ω/∂v_k = −Σ_{e ∋ k} (r_a × r_b)/(l_k (l_a l_b + r_a·r_b))
//! ```
//!
//! The second is what the edges sweep as seen from s, δΩ = −∮ (r × dl)·δv/r³. Far from a triangle the two terms of its multipole series
//! are differentiated with its area, centroid and second moments, and between both their blend, whose reach follows the corners' distances from the centroid.
//!
//! What moves with all corners, the triangle seen from a fixed point, moves against it: the gradient in s is −Σ_k ∂/∂v_k.
//!
//! # References
//! D. R. Wilton et al. (as for [`single`](mod@super::single)), for the integrals; the transport theorem for moving surfaces gives the rest.

mod dual;
mod facet;
mod points;
mod sweep;

use super::sum::transposed;
use super::{Sources, Triangles};
use crate::lie::Vec3;
use facet::Facet;
use sweep::sweep;

/// Which form of a panel's layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// In closed form at any distance.
    Closed,
    /// As [`single`](mod@super::single) and [`double`](mod@super::double) sum them: multipoles far from a panel.
    Blended,
}

/// Sums over points of what one panel's layers are worth there, each times the point's number in a column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CornerSums {
    /// Of the single layer `w ∫ 1/r dA`.
    pub single: f64,
    /// Of its derivatives with respect to the corners, 1/m.
    pub single_corners: [Vec3; 3],
    /// Of those of the double layer `w Ω`, 1/m.
    pub double_corners: [Vec3; 3],
}

/// Numbers in [`CornerSums`].
const NUMBERS: usize = 19;

impl CornerSums {
    fn add(&mut self, x: &[f64; NUMBERS]) {
        self.single += x[0];
        for k in 0..3 {
            self.single_corners[k] += Vec3::from_column_slice(&x[1 + 3 * k..4 + 3 * k]);
            self.double_corners[k] += Vec3::from_column_slice(&x[10 + 3 * k..13 + 3 * k]);
        }
    }
}

/// `out[i][k] += Σ_j a[j][k] (S_ij, ∂S_ij/∂v, ∂Ω_ij/∂v)` of the single and double layers S and Ω of panel i at point j; `a` is
/// `[source][k]`, `out` is `[target][k]`. The gradient of `barᵀ S a` in the corners of panel i is `Σ_k bar[i][k]` of its column's.
pub fn corner_vjp(
    targets: &Triangles,
    sources: &Sources,
    form: Form,
    a: &[f64],
    columns: usize,
    out: &mut [CornerSums],
) {
    sweep(targets, sources, form, None, a, columns, out);
}

/// Tangent of [`corner_vjp`] when point j moves by `d_j`: `out[i][k] += Σ_j a[j][k] d_j·∇ (S_ij, ∂S_ij/∂v, ∂Ω_ij/∂v)`.
pub fn corner_hvp(
    targets: &Triangles,
    sources: &Sources,
    form: Form,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [CornerSums],
) {
    sweep(targets, sources, form, Some(d), a, columns, out);
}

/// `out[j][k] += Σ_i (single[i][k] ∇S_ij + double[i][k] ∇Ω_ij)`, the gradient in point j of both layers in [closed form](Form::Closed); `single` and `double` are
/// `[target][k]`, `out` is `[source][k][3]`. On its own panel a point has the derivative along the normal of one of its sides.
pub fn layers_vjp(
    targets: &Triangles,
    sources: &Sources,
    single: &[f64],
    double: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    let weights = points::in_turn(single, double, columns);
    transposed(points::Both(targets), sources, None, &weights, columns, out);
}
