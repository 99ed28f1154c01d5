//! Potential of a point source at points, `1/|r|` with `r = x_i − s`.
//!
//! ```text
//! ∇_s P = r/r³
//! ∇∇P d = (3 (r·d) r/r² − d)/r³
//! ```

mod hvp;
mod jvp;
mod value;
mod vjp;

pub use hvp::{potential_hessian_product, potential_hvp};
pub use jvp::potential_jvp;
#[cfg(test)]
pub(super) use value::inverse_distance;
pub use value::{potential, potential_fill, potential_sum};
pub use vjp::{potential_gradient, potential_vjp};
