//! Coulomb sums between clouds of charges by Cartesian multipoles, for numbers and for dual numbers.
//!
//! The energy of charges is a function of their moments, and these of their places; what charges see of each other (the potential, the energy's gradient in
//! the charges) and the forces on them (its gradient in their places) are the transposes written beside it. Their tangents are the same code with dual numbers.
//!
//! # References
//! Z.-H. Duan and R. Krasny, J. Comput. Chem. 22 (2001) 184, for the recurrence of the derivatives.

mod exchange;
mod moments;
mod number;
mod table;

pub use exchange::{derivatives, energy, see, signed, unfold};
pub use moments::{
    add_moments, monomials, potential, potential_gradient, shift, shift_back, shift_gradient,
};
pub use table::{MOST, Table};

pub use number::{Arithmetic, DualPack, Number, Pack, WIDTH, inverse_distances};

/// Runs `op`, all of it inlined, with the widest vectors of this processor. Nothing is contracted: results are the same whatever the width.
pub fn vectorized<R>(op: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(op)
}
