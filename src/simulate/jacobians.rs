//! The linearisation of a rollout: its last state against its first and its controls.

use super::Rollout;
use super::trajectory::Seed;
use crate::Result;
use crate::dynamics::{StateBar, StepBar};
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

impl Rollout {
    /// Jacobians of the last state, all rows in one reverse sweep: each step is evaluated, and its stages factored, once. Of a
    /// rollout of one step, the A and B of x₁ ≈ A x₀ + B u. Each row is that of [`Rollout::vjp`], to the bit.
    ///
    /// # Errors
    /// As [`Rollout::vjp`].
    pub fn jacobians(&self) -> Result<Jacobians> {
        let system = self.simulator.system();
        let (nv, nu) = (system.tree.velocities(), system.controls);
        let trajectory = self.simulator.trajectory(&self.controls);
        let (states, steps) = (self.states(), self.steps());
        let time = |n: usize| trajectory.stepper.time(&states[n]);
        let at = |n: usize| {
            let e = trajectory.stepper.linearise(&states[n].q);
            e.map_err(|e| e.at_time(time(n)))
        };
        let zero = Seed::zeros(nv);
        let end = at(steps)?;
        let mut rows = (0..2 * nv)
            .into_par_iter()
            .map(|row| {
                let StateBar { q, y: v } = StateBar::unit(nv, row);
                let mut seed = Seed::zeros(nv);
                (seed.q, seed.v) = (q, v);
                let read = &self.samples()[steps].v;
                let bar = trajectory.seed_vjp(&end, &states[steps], read, &seed)?;
                Ok(bar.state)
            })
            .collect::<Result<Vec<StateBar>>>()?;
        let mut controls = DMatrix::zeros(2 * nv, nu * steps);
        let mut first = None;
        for (n, record) in self.tape.records().iter().enumerate().rev() {
            let step = trajectory.linearise(record)?;
            let before = rows.par_iter().map(|row| step.vjp(row, &zero));
            let before = before.collect::<Result<Vec<_>>>()?;
            rows.clear();
            for (i, (state, partial)) in before.into_iter().enumerate() {
                for (k, u) in partial.control.iter().enumerate() {
                    controls[(i, n * nu + k)] = *u;
                }
                rows.push(state);
            }
            first = Some(step);
        }
        // y₀ = y(q₀, v₀).
        let e = first.as_ref().map_or(&end, |step| step.linearisation());
        let start = |row: &StateBar| {
            let mut bar = StepBar::zeros(e);
            bar.state.q = row.q.clone();
            let (stepper, v) = (&trajectory.stepper, &self.initial_velocity);
            stepper.conserved_vjp(e, v, &row.y, &mut bar)?;
            self.simulator.forget_driven(&mut bar.state.q, &mut bar.v);
            let StateBar { q, .. } = bar.state;
            Ok(StateBar { q, y: bar.v })
        };
        let found = rows.par_iter().map(start).collect::<Result<Vec<_>>>()?;
        let state = StateBar::stacked(nv, &found);
        Ok(Jacobians { state, controls })
    }
}
