//! Linearisations: of every step of a rollout, and of its last state against its first and its controls.

use super::Rollout;
use super::step_map::{BESIDE, Columns, StepMap};
use crate::Result;
use crate::dynamics::State;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Derivatives of a state x = (q, v), the coordinates in their tangent space.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobians {
    /// With respect to the state before it, or to that at the start: 2nv × 2nv.
    pub state: DMatrix<f64>,
    /// With respect to the controls of the steps between, 2nv × (controls · steps): those of the first step, then those of the second, …
    pub controls: DMatrix<f64>,
    /// With respect to the parameters that were asked for, in that order: 2nv × parameters.
    pub parameters: DMatrix<f64>,
}

impl Rollout {
    /// Jacobians of the last state. Of a rollout of one step, the A and B of x₁ ≈ A x₀ + B u. Each row is that of
    /// [`Rollout::vjp`], to rounding.
    ///
    /// # Errors
    /// As [`Rollout::vjp`].
    pub fn jacobians(&self) -> Result<Jacobians> {
        self.jacobians_with(&[])
    }

    /// The same with those of the parameters of these names.
    ///
    /// # Errors
    /// As there, and a name that no parameter has.
    pub fn jacobians_with(&self, parameters: &[&str]) -> Result<Jacobians> {
        let trajectory = self.simulator.trajectory(&self.controls);
        let columns = self.map_columns(&trajectory, parameters)?;
        let (states, samples, steps) = (self.states(), self.samples(), self.steps());
        let nu = columns.of_controls().len();
        let end = trajectory.at(&states[steps].q, samples[steps].time)?;
        let v = &samples[steps].v;
        let [velocity, mut conserved] = columns.readout(&trajectory, &end, &states[steps], v)?;
        let mut rows = Jacobians::of_end(&columns, &velocity);
        rows.controls = DMatrix::zeros(rows.state.nrows(), nu * steps);
        let mut to = steps;
        while to > 0 {
            let chunk = to.saturating_sub(BESIDE)..to;
            let maps = self.step_maps(&trajectory, &columns, chunk.clone())?;
            for (n, map) in chunk.clone().zip(maps).rev() {
                let next = &map.next;
                let range = |r: Range<usize>| next.columns_range(r);
                let before = &rows.state * range(columns.state());
                let control = &rows.state * range(columns.of_controls());
                rows.parameters += &rows.state * range(columns.of_parameters());
                rows.controls.columns_mut(n * nu, nu).copy_from(&control);
                rows.state = before;
                conserved = map.conserved;
            }
            to = chunk.start;
        }
        // y₀ = y(q₀, v₀).
        if self.initial_velocity != samples[0].v {
            let e = trajectory.at(&states[0].q, samples[0].time)?;
            let v = &self.initial_velocity;
            [_, conserved] = columns.readout(&trajectory, &e, &states[0], v)?;
        }
        rows.start(&columns, &conserved);
        let nv = rows.state.nrows() / 2;
        for mut row in rows.state.row_iter_mut() {
            let part = |from: usize| DVector::from_fn(nv, |i, _| row[from + i]);
            let (mut q, mut v) = (part(0), part(nv));
            self.simulator.forget_driven(&mut q, &mut v);
            for i in 0..nv {
                (row[i], row[nv + i]) = (q[i], v[i]);
            }
        }
        Ok(rows)
    }

    /// A and B of x_{n+1} ≈ A x_n + B u_n for every step, the controller's feedback included, and the derivatives with respect to the parameters of these
    /// names at a given x_n. Steps are taken on all cores; the numbers don't depend on how many there are. What no change of the state can move
    /// (coordinates of joints that a motion drives, velocities of all that are driven or held) has zero columns.
    ///
    /// # Errors
    /// As [`Rollout::jacobians_with`].
    pub fn step_jacobians(&self, parameters: &[&str]) -> Result<Vec<Jacobians>> {
        let trajectory = self.simulator.trajectory(&self.controls);
        let columns = self.map_columns(&trajectory, parameters)?;
        let (states, samples, steps) = (self.states(), self.samples(), self.steps());
        let made = self.step_maps(&trajectory, &columns, 0..steps)?;
        let end = trajectory.at(&states[steps].q, samples[steps].time)?;
        let v = &samples[steps].v;
        let [last, _] = columns.readout(&trajectory, &end, &states[steps], v)?;
        let after = made.iter().skip(1).map(|map| &map.velocity);
        let each = made.iter().zip(after.chain([&last])).zip(states);
        let one = |((map, velocity), state): ((&StepMap, &DMatrix<f64>), &State)| {
            let end = Jacobians::of_end(&columns, velocity);
            let range = |r: Range<usize>| map.next.columns_range(r);
            let mut out = Jacobians {
                state: &end.state * range(columns.state()),
                controls: &end.state * range(columns.of_controls()),
                parameters: end.parameters + &end.state * range(columns.of_parameters()),
            };
            out.start(&columns, &map.conserved);
            let split = trajectory.stepper.split_at(state);
            let nv = out.state.nrows() / 2;
            for i in 0..nv {
                for (gone, column) in [(split.moved[i], i), (split.is_driven[i], nv + i)] {
                    if gone {
                        out.state.column_mut(column).fill(0.0);
                    }
                }
            }
            out
        };
        Ok(each.map(one).collect())
    }
}

impl Jacobians {
    /// Those of (q, v) at a state with respect to (q, y) there, from the velocity's.
    fn of_end(columns: &Columns, velocity: &DMatrix<f64>) -> Self {
        let nv = velocity.nrows();
        let mut state = DMatrix::zeros(2 * nv, 2 * nv);
        state.view_mut((0, 0), (nv, nv)).fill_with_identity();
        let own = velocity.columns_range(columns.state());
        state.rows_mut(nv, nv).copy_from(&own);
        let mut parameters = DMatrix::zeros(2 * nv, columns.of_parameters().len());
        let own = velocity.columns_range(columns.of_parameters());
        parameters.rows_mut(nv, nv).copy_from(&own);
        Self {
            state,
            controls: DMatrix::zeros(2 * nv, 0),
            parameters,
        }
    }

    /// From derivatives with respect to (q, y) at the start to those with respect to (q, v), y(q, v) being given.
    fn start(&mut self, columns: &Columns, conserved: &DMatrix<f64>) {
        let nv = conserved.nrows();
        let by_y = self.state.columns(nv, nv).into_owned();
        let through = &by_y * conserved;
        self.parameters += through.columns_range(columns.of_parameters());
        self.state.columns_mut(nv, nv).fill(0.0);
        self.state += through.columns_range(columns.state());
    }
}
