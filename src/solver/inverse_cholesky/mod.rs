//! A sparse factor of a matrix' inverse: L Lᵀ ≈ Θ⁻¹, optimal in the sense of Kullback and Leibler on its pattern.
//!
//! Points are taken from coarse to fine ([`order`]), and column i of L may reach the points before i within ρ of its scale. Of all such L
//! it is the one whose normal distribution N(0, (L Lᵀ)⁻¹) is nearest to N(0, Θ), which is
//!
//! ```text
//! L_{s,i} = Θ_{s,s}⁻¹ e / √(eᵀ Θ_{s,s}⁻¹ e),   s the rows of column i, e the unit vector of i among them
//! ```
//!
//! Columns of neighbours of like scale share their rows ([`supernodes`]) and one dense Cholesky factor, from which each follows by back
//! substitution. Applying L or Lᵀ is a sparse product.
//!
//! # References
//! Schäfer, Katzfuss and Owhadi, Sparse Cholesky factorization by Kullback–Leibler minimization (2021); Chen, Schäfer and Desbrun, Lightning-fast method of
//! fundamental solutions (2024), [CSD24] in the paper.

mod order;
mod supernodes;

use super::{Columns, SparseRows};
use crate::adjoint::lie::Vec3;
use faer::linalg::triangular_solve::solve_upper_triangular_in_place;
use faer::{Mat, Par, Side};
use order::Order;
use rayon::prelude::*;
use supernodes::{Supernode, supernodes};

/// Least ρ: with less hardly any point would have a neighbour.
pub const LEAST_RHO: f64 = 1.0;
/// Supernodes whose blocks are held at once, however many threads there are.
pub(crate) const AT_ONCE: usize = 16;

/// The factor L.
#[derive(Clone, Debug)]
pub struct InverseCholesky {
    rows: SparseRows,
    transposed: SparseRows,
}

/// A column: its row and value of each entry.
type Column = (usize, Vec<(usize, f64)>);

impl InverseCholesky {
    /// The factor for a symmetric positive definite Θ that belongs to points (finite, m), a row each; `theta` gives its entries between some of them. Where a block
    /// isn't definite in floating point, its columns are those of the diagonal.
    pub fn new(points: &[Vec3], rho: f64, theta: impl Fn(&[usize]) -> Mat<f64> + Sync) -> Self {
        let order = Order::new(points, rho.max(LEAST_RHO));
        let nodes = supernodes(&order);
        let mut columns: Vec<Column> = Vec::with_capacity(points.len());
        for nodes in nodes.chunks(AT_ONCE) {
            let made = nodes
                .par_iter()
                .map(|node| columns_of(node, &order, &theta));
            columns.extend(made.collect::<Vec<_>>().into_iter().flatten());
        }
        columns.sort_unstable_by_key(|(at, _)| *at);
        let transposed = SparseRows::new(columns.into_iter().map(|(_, entries)| entries));
        Self {
            rows: transposed.transposed(points.len()),
            transposed,
        }
    }

    /// L, row by row.
    pub fn rows(&self) -> &SparseRows {
        &self.rows
    }

    /// Lᵀ, row by row.
    pub fn transposed(&self) -> &SparseRows {
        &self.transposed
    }

    /// L x.
    pub fn apply(&self, x: &Columns) -> Columns {
        self.rows.product(x)
    }

    /// Lᵀ x.
    pub fn apply_transpose(&self, x: &Columns) -> Columns {
        self.transposed.product(x)
    }
}

/// The columns of a supernode.
fn columns_of(
    node: &Supernode,
    order: &Order,
    theta: &impl Fn(&[usize]) -> Mat<f64>,
) -> Vec<Column> {
    let rows: Vec<usize> = node.rows.iter().map(|at| order.points[*at]).collect();
    let block = theta(&rows);
    let mut out = Mat::zeros(rows.len(), node.members.len());
    let factor = block.llt(Side::Lower);
    for (k, at) in node.members.iter().enumerate() {
        out[(*at, k)] = match factor {
            Ok(_) => 1.0,
            Err(_) => 1.0 / block[(*at, *at)].sqrt(),
        };
    }
    if let Ok(factor) = factor {
        // With e_m on the right what lies behind m stays zero.
        solve_upper_triangular_in_place(factor.L().transpose(), out.as_mut(), Par::Seq);
    }
    let column = |(k, at): (usize, &usize)| {
        let entries = (0..=*at).map(|i| (rows[i], out[(i, k)]));
        (rows[*at], entries.collect())
    };
    node.members.iter().enumerate().map(column).collect()
}

#[cfg(test)]
mod tests;
