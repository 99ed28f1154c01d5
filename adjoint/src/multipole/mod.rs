//! Coulomb sums between clouds of charges by Cartesian multipoles, for numbers and for dual numbers.
//!
//! The energy of charges is a function of their moments, and these of their places; what charges see of each other (the potential, the energy's gradient in
//! the charges) and the forces on them (its gradient in their places) are the transposes written beside it. Their tangents are the same code with dual numbers.
//!
//! # References
//! Z.-H. Duan and R. Krasny, J. Comput. Chem. 22 (2001) 184, for the recurrence of the derivatives.

mod exchange;
mod moments;
mod table;

pub use exchange::{derivatives, energy, see, signed};
pub use moments::{
    add_moments, monomials, potential, potential_gradient, shift, shift_back, shift_gradient,
};
pub use table::{MOST, Table};

use num_dual::DualNum;

/// A number, or one that carries its derivatives.
pub trait Number: DualNum<Primitive = f64> + Copy + Send + Sync {}

impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Number for T {}
