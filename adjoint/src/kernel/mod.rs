//! Point sources seen by the surface of a body, and their sums.
//!
//! A point source at `s` of density α has potential φ = α/|x − s| and velocity −∇φ = α (x − s)/|x − s|³.
//! Its trace on element `i` of a surface is one entry `K_ij` of a dense matrix, targets × sources:
//!
//! | kernel | targets | `K_ij` |
//! |---|---|---|
//! | [`flux`](mod@flux) | [`Triangles`] | `w_i ∫ n·r/r³ dA = w_i Ω_i(s)`, the solid angle |
//! | [`double`](mod@double) | [`Triangles`] | the same, by multipoles far from a triangle |
//! | [`normal`](mod@normal) | [`Points`] | `w_i n_i·r/r³` |
//! | [`single`](mod@single) | [`Triangles`] | `w_i ∫ 1/r dA`, the potential of a panel of constant density |
//! | [`potential`](mod@potential) | [`Points`] | `1/r` (no row weight) |
//!
//! with `r = x − s`. Targets do not move in the frame of their body, and sources are given in that frame, so every
//! entry is a function of its source position alone, and the ladder is
//!
//! | rung | sum |
//! |---|---|
//! | `*_fill` | `K_ij`, row-major |
//! | `potential_sum`, `single_sum` | `out[j][k] += Σ_i K_ij bar[i][k]` |
//! | `*_jvp` | `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`, the tangent of `K a` when source `j` moves by `d_j` |
//! | `*_vjp` | `out[j][k] += Σ_i bar[i][k] ∇K_ij`, a 3-vector per source and column |
//! | `*_hvp` | `out[j][k] += Σ_i bar[i][k] ∇∇K_ij d_j`, the tangent of `*_vjp` |
//!
//! with ∇ the gradient in `s_j`. Contracting `*_vjp` with `a[j][k]` over `k` gives the gradient of
//! `barᵀ K a`.
//!
//! Arrays with columns are row-major with the column fastest: `[target][k]`, `[source][k]`, and
//! `[source][k][3]` for gradients. All sums *add* to `out`.
//!
//! Sources must not lie on a target (a corner or edge of a triangle, a point): the kernels are
//! singular there and the result is not finite. Callers keep sources inside bodies.
//!
//! Results do not depend on the number of threads, to the last bit. They may differ in round-off
//! between processors of different vector width.

pub mod corner;
pub mod double;
pub mod flux;
mod lane;
mod layer;
pub mod normal;
mod panel;
mod point;
pub mod potential;
mod registry;
pub mod single;
mod source;
mod sum;
mod target;
#[cfg(test)]
mod tests;

pub(crate) use lane::{Lane, Lanes, V3, cross, dot, scale, scale_add};
pub(crate) use source::WIDTH;
pub(crate) use sum::dispatch;

pub use corner::{CornerSums, Form, corner_hvp, corner_vjp, layers_vjp};
pub use double::{double_fill, double_hvp, double_jvp, double_vjp};
pub use flux::{
    flux, flux_fill, flux_gradient, flux_hessian_product, flux_hvp, flux_jvp, flux_vjp,
};
pub use normal::{
    normal, normal_fill, normal_gradient, normal_hessian_product, normal_hvp, normal_jvp,
    normal_vjp,
};
pub use panel::radius_squared;
pub use potential::{
    potential, potential_fill, potential_gradient, potential_hessian_product, potential_hvp,
    potential_jvp, potential_sum, potential_vjp,
};
pub use registry::rungs;
pub use single::{
    single, single_gradient, single_hessian_product, single_hvp, single_jvp, single_sum, single_vjp,
};
pub use source::Sources;
pub use target::{Points, Triangles};

/// What a `fill` does with the entries that are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Write {
    /// Overwrite.
    Set,
    /// Add, for example the images of sources.
    Add,
}
