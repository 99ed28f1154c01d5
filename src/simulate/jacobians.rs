//! The linearisation of a rollout: its last state against its first and its controls.

use super::Rollout;
use crate::Result;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Derivatives of the last state x_N of a rollout, x = (q, v) with the coordinates in their tangent space.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobians {
    /// ∂x_N / ∂x₀, 2nv × 2nv.
    pub state: DMatrix<f64>,
    /// ∂x_N / ∂u, 2nv × (controls · N): the controls of the first step, then those of the second, …
    pub controls: DMatrix<f64>,
}

impl Rollout<'_> {
    /// Jacobians of the last state, row by row from [`Rollout::vjp`]: of a rollout of one step, the A and B of
    /// x₁ ≈ A x₀ + B u.
    ///
    /// # Errors
    /// As [`Rollout::vjp`].
    pub fn jacobians(&self) -> Result<Jacobians> {
        let nv = self.simulator().system().tree.velocities();
        let rows = (0..2 * nv).into_par_iter().map(|i| {
            let mut seed = self.zero_cotangents();
            let part = if i < nv { &mut seed.q } else { &mut seed.v };
            part[(i % nv, self.steps())] = 1.0;
            self.vjp(&seed)
        });
        let rows = rows.collect::<Result<Vec<_>>>()?;
        let mut out = Jacobians {
            state: DMatrix::zeros(2 * nv, 2 * nv),
            controls: DMatrix::zeros(2 * nv, self.controls().len()),
        };
        for (i, row) in rows.iter().enumerate() {
            let state = row.initial.q.iter().chain(&row.initial.v);
            for (j, x) in state.enumerate() {
                out.state[(i, j)] = *x;
            }
            for (j, x) in row.controls.iter().enumerate() {
                out.controls[(i, j)] = *x;
            }
        }
        Ok(out)
    }
}
