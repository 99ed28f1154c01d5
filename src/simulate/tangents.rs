//! Forward mode: how a trajectory moves as its start, its controls, its parameters and its controller's gains do.
//!
//! Every step is made a matrix ([`StepMap`](super::step_map::StepMap)), many steps side by side on all cores; then a direction costs a product with it.
//! It is the derivative that [`Rollout::vjp`] is the transpose of.

use super::directions::{Directions, Displacement, Variables};
use super::gains::Reads;
use super::observable::{Differentiable, Observed, ObservedTangents, differentiable};
use super::step_map::{BESIDE, Columns};
use super::{Initial, Rollout, finite};
use crate::{Error, Result, memory};
use nalgebra::{DMatrix, DVector};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::ControlFlow;

/// How what a rollout observes changes along a direction: the counterpart of [`Cotangents`](super::Cotangents). Columns are states 0 … N.
#[derive(Clone, Debug, PartialEq)]
pub struct Tangents {
    /// Of q in its tangent space, nv × (N + 1).
    pub q: DMatrix<f64>,
    /// Of v, nv × (N + 1).
    pub v: DMatrix<f64>,
    /// Of the controls that acted, controls × N; columns are steps.
    pub applied_controls: DMatrix<f64>,
    /// Of the observables that were asked for, by name: their tangents × (N + 1).
    pub observables: BTreeMap<String, DMatrix<f64>>,
}

/// An observable by its name, with the number of its tangents and the states that it is read from.
type Named = (String, &'static dyn Differentiable, usize, Reads);

/// Tangents of one state along all directions.
struct Moved<'a> {
    state: usize,
    q: &'a DMatrix<f64>,
    v: &'a DMatrix<f64>,
    /// Of the controls that act from there on; none at the end.
    applied: Option<&'a DMatrix<f64>>,
}

impl Rollout {
    /// A displacement of the right sizes for this rollout, all zero.
    pub fn zero_displacement(&self) -> Displacement {
        let nv = self.simulator.system().tree.velocities();
        Displacement {
            controls: DMatrix::zeros(self.controls.nrows(), self.steps()),
            initial: Initial {
                q: DVector::zeros(nv),
                v: DVector::zeros(nv),
            },
            parameters: self.simulator.parameters().zeros(),
            gains: vec![0.0; self.simulator.policy().gains().len()],
        }
    }

    /// Tangents of the trajectory along each displacement, with those of the observables of these names. All displacements share the work of the steps.
    ///
    /// # Errors
    /// Displacements of other sizes than [`Rollout::zero_displacement`] or not finite; a name that no observable with derivatives has; a solve that misses its
    /// tolerance; tangents that leave floating point.
    pub fn jvp(
        &self,
        displacements: &[Displacement],
        observables: &[&str],
    ) -> Result<Vec<Tangents>> {
        self.jvp_with(displacements, observables, |_| ControlFlow::Continue(()))
    }

    /// As [`Rollout::jvp`]; `progress` is called with the number of steps gone through, and may end the sweep.
    ///
    /// # Errors
    /// As there, and [`Error::Stopped`] if `progress` breaks.
    pub fn jvp_with(
        &self,
        displacements: &[Displacement],
        observables: &[&str],
        progress: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<Vec<Tangents>> {
        self.check_displacements(displacements)?;
        let mut named = self.named(observables)?;
        let mut known = HashSet::new();
        named.retain(|(name, ..)| known.insert(name.clone()));
        let states = self.steps() + 1;
        let nv = self.simulator.system().tree.velocities();
        let nu = self.controls.nrows();
        let rows = 2 * nv + nu + named.iter().map(|(_, _, rows, _)| rows).sum::<usize>();
        memory::fits(
            &format!(
                "tangents of {states} states along {} displacements",
                displacements.len()
            ),
            memory::numbers((rows * states) as f64 * displacements.len() as f64),
            "take fewer displacements or observables at a time",
        )?;
        let zero = |rows| DMatrix::zeros(rows, states);
        let each = named
            .iter()
            .map(|(name, _, rows, _)| (name.clone(), zero(*rows)));
        let empty = Tangents {
            q: zero(nv),
            v: zero(nv),
            applied_controls: DMatrix::zeros(nu, self.steps()),
            observables: each.collect(),
        };
        let mut out = vec![empty; displacements.len()];
        let directions = self.directions_of(displacements);
        let write = |at: &Moved| {
            for (k, out) in out.iter_mut().enumerate() {
                out.q.set_column(at.state, &at.q.column(k));
                out.v.set_column(at.state, &at.v.column(k));
                if let Some(applied) = at.applied {
                    out.applied_controls
                        .set_column(at.state, &applied.column(k));
                }
            }
            for (name, observable, _, _) in &named {
                let seen = self.observed(*observable, &directions, at);
                for (k, out) in out.iter_mut().enumerate() {
                    if let Some(to) = out.observables.get_mut(name) {
                        to.set_column(at.state, &seen.column(k));
                    }
                }
            }
            Ok(())
        };
        self.sweep(&directions, write, progress)?;
        for out in &mut out {
            for (name, _, _, reads) in &named {
                if let Some(read) = out.observables.get_mut(name) {
                    *read = reads.apply(std::mem::take(read));
                }
            }
        }
        Ok(out)
    }

    /// Jacobian of observables ("q" and "v" among them) at the given states with respect to `variables`, one matrix for each name: its rows are the tangents at the
    /// first of the states, then those at the second, …
    ///
    /// # Errors
    /// As [`Rollout::jvp`], and a state that there isn't or a name that no parameter has.
    pub fn jacobian(
        &self,
        variables: &Variables,
        observables: &[&str],
        states: &[usize],
    ) -> Result<Vec<DMatrix<f64>>> {
        self.jacobian_with(
            variables,
            observables,
            states,
            |_| ControlFlow::Continue(()),
        )
    }

    /// As [`Rollout::jacobian`]; `progress` is called with the number of steps gone through, and may end the sweep.
    ///
    /// # Errors
    /// As there, and [`Error::Stopped`] if `progress` breaks.
    pub fn jacobian_with(
        &self,
        variables: &Variables,
        observables: &[&str],
        states: &[usize],
        progress: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<Vec<DMatrix<f64>>> {
        if let Some(bad) = states.iter().find(|n| **n > self.steps()) {
            return Err(Error::input(
                "jacobian: states",
                bad,
                format!("must be at most {}, the last state", self.steps()),
            ));
        }
        let named = self.named(observables)?;
        let directions = self.directions_to(variables)?;
        let count = directions.q.ncols();
        let entries: usize = named
            .iter()
            .map(|(_, _, rows, _)| rows * states.len())
            .sum();
        // With what is carried along from state to state.
        let inputs =
            self.controls.nrows() + directions.parameters.nrows() + directions.gains.nrows();
        let entries = entries + 4 * directions.q.nrows() + 2 * inputs;
        memory::fits(
            &format!(
                "Jacobians of {} states with respect to {count} variables",
                states.len()
            ),
            memory::numbers(entries as f64 * count as f64),
            "ask for fewer states or variables at a time",
        )?;
        let zero = |rows: &usize| DMatrix::zeros(rows * states.len(), count);
        let mut out: Vec<_> = named.iter().map(|(_, _, rows, _)| zero(rows)).collect();
        let readers: Vec<_> = named
            .iter()
            .map(|(.., reads)| readers(*reads, states))
            .collect();
        let write = |at: &Moved| {
            for (((_, observable, rows, _), readers), out) in
                named.iter().zip(&readers).zip(&mut out)
            {
                let Some(readers) = readers.get(&at.state) else {
                    continue;
                };
                let seen = self.observed(*observable, &directions, at);
                for (place, weight) in readers {
                    let mut out = out.rows_mut(place * rows, *rows);
                    out += *weight * &seen;
                }
            }
            Ok(())
        };
        self.sweep(&directions, write, progress)?;
        Ok(out)
    }

    /// Observables with derivatives.
    fn named(&self, names: &[&str]) -> Result<Vec<Named>> {
        let of = |name: &&str| {
            let found = differentiable(name)?;
            let rows = found.tangents(self.simulator.system());
            Ok(((*name).to_string(), found, rows, self.reads(name, found)?))
        };
        names.iter().map(of).collect()
    }

    /// Goes through the trajectory along all directions; `each` sees every state.
    fn sweep(
        &self,
        directions: &Directions,
        mut each: impl FnMut(&Moved) -> Result<()>,
        mut progress: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<()> {
        let trajectory = self.simulator.trajectory(&self.controls);
        let columns = Columns::new(&trajectory, directions.places.clone());
        let (states, samples, steps) = (self.states(), self.samples(), self.steps());
        let nv = directions.q.nrows();
        let inputs = columns.of_chosen(&directions.parameters);
        // y₀ = y(q₀, v₀).
        let e = trajectory.at(&states[0].q, samples[0].time)?;
        let (q, v) = (&directions.q, &directions.v);
        let start = &self.initial_velocity;
        let stepper = &trajectory.stepper;
        let momentum = stepper.momentum_slopes(&e, start, inputs.has_parameters())?;
        let y = stepper.conserved_jvp(&e, start, momentum.as_ref(), q, v, &inputs);
        let state = |along: &DMatrix<f64>, n: usize| {
            let (q, y) = (
                along.rows(0, nv).into_owned(),
                along.rows(nv, nv).into_owned(),
            );
            finite::tangents(&self.simulator.scene, states[n].step, &q, &y)?;
            Ok::<_, Error>(q)
        };
        let mut along = DMatrix::zeros(columns.of_gains().end, q.ncols());
        along.rows_mut(0, nv).copy_from(q);
        along.rows_mut(nv, nv).copy_from(&y);
        let constant = [
            (columns.of_parameters(), &directions.parameters),
            (columns.of_gains(), &directions.gains),
        ];
        for (rows, tangents) in constant {
            along.rows_range_mut(rows).copy_from(tangents);
        }
        let mut from = 0;
        while from < steps {
            let chunk = from..(from + BESIDE).min(steps);
            let maps = self.step_maps(&trajectory, &columns, chunk.clone())?;
            for (n, map) in chunk.clone().zip(maps) {
                let controls = (directions.controls)(n);
                along
                    .rows_range_mut(columns.of_controls())
                    .copy_from(&controls);
                let (q, v) = (state(&along, n)?, map.velocity * &along);
                each(&Moved {
                    state: n,
                    q: &q,
                    v: &v,
                    applied: Some(&(map.applied * &along)),
                })?;
                let next = map.next * &along;
                along.rows_range_mut(columns.state()).copy_from(&next);
                if progress(n + 1).is_break() {
                    return Err(Error::Stopped {
                        what: format!("the tangents, {} of {steps} steps on", n + 1),
                    });
                }
            }
            from = chunk.end;
        }
        let q = state(&along, steps)?;
        let y = along.rows(nv, nv).into_owned();
        let e = trajectory.at(&states[steps].q, samples[steps].time)?;
        let at = crate::dynamics::StateTangents { q, y };
        let momentum = stepper.momentum_slopes(&e, &samples[steps].v, inputs.has_parameters())?;
        let v = stepper.velocity_jvp(&e, &states[steps], momentum.as_ref(), &at, &inputs)?;
        each(&Moved {
            state: steps,
            q: &at.q,
            v: &v,
            applied: None,
        })
    }

    /// Tangents of an observable at a state, a column for each direction.
    fn observed(
        &self,
        observable: &dyn Differentiable,
        directions: &Directions,
        at: &Moved,
    ) -> DMatrix<f64> {
        let (system, parameters) = (self.simulator.system(), self.simulator.parameters());
        let (tree, sample) = (&system.tree, &self.samples()[at.state]);
        let kinematics = tree.kinematics(&sample.q);
        let here = Observed {
            system,
            parameters,
            kinematics: &kinematics,
            v: &sample.v,
            twists: &tree.twists(&kinematics, &sample.v),
        };
        let mut out = DMatrix::zeros(observable.tangents(system), at.q.ncols());
        for (k, mut out) in out.column_iter_mut().enumerate() {
            let (q, v) = (at.q.column(k).into_owned(), at.v.column(k).into_owned());
            let [displacement, twist] = tree.twists_jvp(&kinematics, &sample.v, &q, &v);
            let changed = directions.parameters_of(k, parameters);
            let along = ObservedTangents {
                displacement: &displacement,
                twist: &twist,
                q: q.as_slice(),
                v: v.as_slice(),
                parameters: changed.as_ref(),
            };
            out.copy_from_slice(&observable.jvp(&here, &along));
        }
        out
    }

    /// An observable at state `n` and its derivatives with respect to that state's (q, v), q in its tangent space: the value, last index fastest, and tangents × 2nv.
    ///
    /// # Errors
    /// A name that no observable with derivatives has, a state that there isn't, a value that can't be found.
    pub fn observable_jacobian(&self, name: &str, n: usize) -> Result<(Vec<f64>, DMatrix<f64>)> {
        let value = self.observable_value(name, n)?;
        let observable = differentiable(name)?;
        if observable.is_gain() {
            return Err(Error::Unsupported {
                what: format!("the derivative of {name:?} with respect to one state"),
                why: "it is the mean over a step, read from two states".into(),
                instead: "take Rollout::jacobian or Rollout::vjp".into(),
            });
        }
        let nv = self.simulator.system().tree.velocities();
        let half =
            |from: usize| DMatrix::from_fn(nv, 2 * nv, |i, k| f64::from(u8::from(k == from + i)));
        let none = DMatrix::zeros(0, 2 * nv);
        let units = Directions {
            q: half(0),
            v: half(nv),
            parameters: none.clone(),
            places: Vec::new(),
            follows: Vec::new(),
            gains: none.clone(),
            controls: Box::new(move |_| none.clone()),
        };
        let at = Moved {
            state: n,
            q: &units.q,
            v: &units.v,
            applied: None,
        };
        Ok((value, self.observed(observable, &units, &at)))
    }
}

/// By state, which of the asked `states` are read from it, by their places, and with which weights.
fn readers(reads: Reads, states: &[usize]) -> HashMap<usize, Vec<(usize, f64)>> {
    let mut out: HashMap<usize, Vec<(usize, f64)>> = HashMap::new();
    for (place, n) in states.iter().enumerate() {
        for (state, weight) in reads.at(*n) {
            out.entry(state).or_default().push((place, weight));
        }
    }
    out
}
