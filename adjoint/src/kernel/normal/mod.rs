//! Normal velocity of a point source at points of a surface, `w_i n_i·r/|r|³` with `r = x_i − s`
//! (the paper's Eq. 18).
//!
//! ```text
//! ∇_s K   = w (3 (n·r) r/r² − n)/r³
//! ∇∇K d   = 3 w (5 (n·r)(r·d) r/r² − (r·d) n − (n·d) r − (n·r) d)/r⁵
//! ```

mod hvp;
mod jvp;
mod value;
mod vjp;

pub use hvp::{normal_hessian_product, normal_hvp};
pub use jvp::normal_jvp;
#[cfg(test)]
pub(super) use value::velocity;
pub use value::{normal, normal_fill};
pub use vjp::{normal_gradient, normal_vjp};
