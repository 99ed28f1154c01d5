//! A step with its controller as one matrix, and the change between velocities and what the integrator carries.

use super::Rollout;
use super::trajectory::{ControlledStep, Trajectory, expect_length, observation};
use crate::Result;
use crate::dynamics::{InputTangents, Linearisation, State, StateTangents};
use crate::error::in_order;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Steps whose maps are made side by side and kept at a time.
pub(super) const BESIDE: usize = 64;

/// What a step is differentiated with respect to, in the order of a map's columns: q and y of its state, its open-loop controls, parameters, gains.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    velocities: usize,
    controls: usize,
    gains: usize,
    all_parameters: usize,
    /// Places of the chosen parameters.
    pub parameters: Vec<usize>,
    /// Where the chosen parameters have an effect beside their own, with its slope: each a column among them, and a parameter's place.
    follows: Vec<(usize, usize, f64)>,
}

/// Derivatives of what a step makes; columns as in [`Columns`].
pub(super) struct StepMap {
    /// Of the velocity at its state, nv × K.
    pub velocity: DMatrix<f64>,
    /// Of y at its state, q and v taking the place of q and y: nv × K.
    pub conserved: DMatrix<f64>,
    /// Of q and y after it, 2nv × K.
    pub next: DMatrix<f64>,
    /// Of the controls that act, controls × K.
    pub applied: DMatrix<f64>,
}

impl Columns {
    /// Of a trajectory's steps, with these parameters.
    pub fn new(trajectory: &Trajectory, parameters: Vec<usize>) -> Self {
        let simulator = trajectory.simulator;
        let system = simulator.system();
        Self {
            velocities: system.tree.velocities(),
            controls: system.controls,
            gains: simulator.policy().gains().len(),
            all_parameters: simulator.parameters().as_slice().len(),
            follows: system.shapes.followers(simulator.parameters(), &parameters),
            parameters,
        }
    }

    /// Of q and y, or of q and v.
    pub fn state(&self) -> Range<usize> {
        0..2 * self.velocities
    }

    pub fn of_controls(&self) -> Range<usize> {
        let from = self.state().end;
        from..from + self.controls
    }

    pub fn of_parameters(&self) -> Range<usize> {
        let from = self.of_controls().end;
        from..from + self.parameters.len()
    }

    pub fn of_gains(&self) -> Range<usize> {
        let from = self.of_parameters().end;
        from..from + self.gains
    }

    /// A row of units on a range of the columns.
    fn units(&self, range: Range<usize>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(range.len(), self.of_gains().end);
        out.columns_range_mut(range).fill_with_identity();
        out
    }

    /// Tangents of the inputs with these of the chosen parameters.
    pub fn inputs(&self, control: DMatrix<f64>, chosen: &DMatrix<f64>) -> InputTangents {
        let rows = match self.parameters.len() {
            0 => 0,
            _ => self.all_parameters,
        };
        let mut parameters = DMatrix::zeros(rows, chosen.ncols());
        for (row, place) in chosen.row_iter().zip(&self.parameters) {
            let mut own = parameters.row_mut(*place);
            own += row;
        }
        for (from, to, slope) in &self.follows {
            let mut follower = parameters.row_mut(*to);
            follower += *slope * chosen.row(*from);
        }
        InputTangents {
            control,
            parameters,
        }
    }

    /// The same without controls.
    pub fn of_chosen(&self, chosen: &DMatrix<f64>) -> InputTangents {
        self.inputs(DMatrix::zeros(self.controls, chosen.ncols()), chosen)
    }

    /// Derivatives of the velocity at a state, as in [`StepMap::velocity`], and of y there, as in [`StepMap::conserved`].
    pub fn readout(
        &self,
        t: &Trajectory,
        e: &Linearisation,
        state: &State,
        v: &DVector<f64>,
    ) -> Result<[DMatrix<f64>; 2]> {
        let (at, inputs) = (
            self.unit_state(),
            self.of_chosen(&self.units(self.of_parameters())),
        );
        let momentum = t.stepper.momentum_slopes(e, v, inputs.has_parameters())?;
        let momentum = momentum.as_ref();
        let velocity = (t.stepper).velocity_jvp(e, state, momentum, &at, &inputs)?;
        let StateTangents { q, y } = &at;
        let conserved = t.stepper.conserved_jvp(e, v, momentum, q, y, &inputs);
        Ok([velocity, conserved])
    }

    fn unit_state(&self) -> StateTangents {
        let n = self.velocities;
        StateTangents {
            q: self.units(0..n),
            y: self.units(n..2 * n),
        }
    }
}

impl Rollout {
    /// The columns of maps of this rollout's steps, with the parameters of these names.
    pub(super) fn map_columns(
        &self,
        trajectory: &Trajectory,
        parameters: &[&str],
    ) -> Result<Columns> {
        let table = self.simulator.parameters();
        let places = parameters.iter().map(|name| table.place(name));
        Ok(Columns::new(trajectory, places.collect::<Result<_>>()?))
    }

    /// The maps of steps, made side by side on all cores.
    pub(super) fn step_maps(
        &self,
        trajectory: &Trajectory,
        columns: &Columns,
        steps: Range<usize>,
    ) -> Result<Vec<StepMap>> {
        let records = &self.tape.records()[steps];
        let map = |record| trajectory.linearise(record)?.map(columns);
        in_order(records.par_iter().map(map))
    }
}

impl ControlledStep<'_, '_> {
    /// The step and its controller, and the velocity at its state, as matrices.
    pub fn map(&self, columns: &Columns) -> Result<StepMap> {
        let (t, record) = (self.trajectory, self.step.record());
        let at = columns.unit_state();
        let chosen = columns.units(columns.of_parameters());
        let time = t.stepper.time(record.state());
        let run = || {
            let (e, v) = (self.step.linearisation(), record.velocity());
            let [velocity, conserved] = columns.readout(t, e, record.state(), v)?;
            let mut control = columns.units(columns.of_controls());
            self.feed_back(columns, &at.q, &velocity, &mut control)?;
            let inputs = columns.inputs(control.clone(), &chosen);
            let StateTangents { q, y } = self.step.jvp(&at, &velocity, &inputs)?;
            let mut next = DMatrix::zeros(2 * q.nrows(), q.ncols());
            next.rows_mut(0, q.nrows()).copy_from(&q);
            next.rows_mut(q.nrows(), q.nrows()).copy_from(&y);
            Ok(StepMap {
                velocity,
                conserved,
                next,
                applied: control,
            })
        };
        run().map_err(|e: crate::Error| e.at_time(time))
    }

    /// Adds what the controller makes of the state's tangents, control by control from its transpose.
    fn feed_back(
        &self,
        columns: &Columns,
        q: &DMatrix<f64>,
        v: &DMatrix<f64>,
        control: &mut DMatrix<f64>,
    ) -> Result<()> {
        let (t, record) = (self.trajectory, self.step.record());
        let state = record.state();
        let seen = observation(&t.stepper, state, record.velocity());
        let policy = t.simulator.policy();
        for c in 0..control.nrows() {
            let bar = DVector::from_fn(control.nrows(), |i, _| f64::from(i == c));
            let action = policy.act_vjp(&seen, &bar)?;
            expect_length("cotangent of q", action.q.len(), q.nrows(), "velocity")?;
            expect_length("cotangent of v", action.v.len(), v.nrows(), "velocity")?;
            expect_length(
                "cotangent of the gains",
                action.gains.len(),
                columns.gains,
                "gain",
            )?;
            let mut row = control.row_mut(c);
            for (part, tangents) in [(action.q, q), (action.v, v)] {
                if !part.is_empty() {
                    row += DVector::from_vec(part).transpose() * tangents;
                }
            }
            for (column, x) in columns.of_gains().zip(action.gains) {
                row[column] += x;
            }
        }
        Ok(())
    }
}
