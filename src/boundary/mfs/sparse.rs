//! A sparse factor of one body's inverse normal equations, for bodies whose dense factor would take too long.

use super::BodyBoundary;
use crate::adjoint::lie::Vec3;
use crate::solver::{AT_ONCE, InverseCholesky, LEAST_RHO};
use crate::{Error, Result, memory};
use faer::{Mat, MatRef};

/// Rows that one supernode may hold at most, about, for each unit of ρ².
const ROWS: f64 = 12.0;

impl BodyBoundary {
    /// L with L Lᵀ ≈ (KᵀK + D²)⁻¹, sources × sources; a source reaches others within `rho` times its scale. K is made column by column where the body doesn't hold it.
    ///
    /// # Errors
    /// A ρ under 1 or not finite, and more memory than there is.
    pub fn sparse_factor(&self, rho: f64) -> Result<InverseCholesky> {
        if !(rho.is_finite() && rho >= LEAST_RHO) {
            return Err(Error::input(
                format!("body \"{}\": rho of the sparse factor", self.name),
                rho,
                "must be 1 or more, e.g. 3",
            ));
        }
        let (faces, sources) = (self.faces.len() as f64, self.sources.len() as f64);
        let rows = (ROWS * rho * rho).min(sources);
        let blocks = AT_ONCE as f64 * (2.0 * faces + rows) * rows;
        memory::fits(
            &format!(
                "the sparse factor of body \"{}\" with {faces} faces",
                self.name
            ),
            // Both L and its transpose, a number and its column each.
            memory::numbers(4.0 * rows * sources + blocks),
            "use fewer faces, a smaller ρ (csd24_rho) or the preconditioner jacobi",
        )?;
        Ok(InverseCholesky::new(&self.sources, rho, |among| {
            self.normal_block(among)
        }))
    }

    /// KᵀK + D² between some sources.
    fn normal_block(&self, among: &[usize]) -> Mat<f64> {
        let (faces, n) = (self.faces.len(), among.len());
        let held = self.flux_rows.len() == faces * self.sources.len();
        let rows: Vec<f64> = if held {
            let rows = self.flux_rows.chunks_exact(self.sources.len());
            rows.flat_map(|row| among.iter().map(|j| row[*j])).collect()
        } else {
            let sources: Vec<Vec3> = among.iter().map(|j| self.sources[*j]).collect();
            self.rows_of(&sources)
        };
        let k = MatRef::from_row_major_slice(&rows, faces, n);
        let mut out = k.transpose() * k;
        for (a, j) in among.iter().enumerate() {
            out[(a, a)] += self.damping[*j].powi(2);
        }
        out
    }
}
