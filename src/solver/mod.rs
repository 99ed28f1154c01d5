//! Iterative solvers with several right-hand sides at once.
//!
//! Arrays are row-major `[row][column]`, columns fastest. Every column has its own coefficients and stops on its own, so
//! that a column's solution doesn't depend on its neighbours; sums run over fixed chunks, so that it
//! doesn't depend on the number of threads either.

mod cgls;
mod cholesky;
mod columns;
mod eigenvalue;
mod gmres;
mod inverse_cholesky;
mod lu;
mod matmul;
mod product;
mod sparse;
mod sparse_rows;

pub use cgls::{Outcome, cgls, cgls_watched};
pub use cholesky::Cholesky;
pub use columns::{Columns, dot};
pub(crate) use eigenvalue::{condition, eigenvalues, growth, largest_eigenvalue, scaled_by};
pub use gmres::{gmres, gmres_beside};
pub(crate) use inverse_cholesky::AT_ONCE;
pub use inverse_cholesky::{InverseCholesky, LEAST_RHO};
pub use lu::Lu;
pub(crate) use matmul::matmul;
pub use product::{both_products, normal_product, product, transposed_product};
pub use sparse::{SparseCholesky, SparsePattern, elimination_order};
pub use sparse_rows::SparseRows;

use crate::adjoint::count::Counter;

/// Calls of this module's solvers and products ([`cgls`], [`gmres`](gmres()), [`product`](product()) and its
/// kin, [`Cholesky`], [`SparseCholesky`], [`Lu`]) in this process.
#[doc(hidden)]
pub static CALLS: Counter = Counter::new();
