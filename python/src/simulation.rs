//! What simulators do: the methods of their class.

use crate::array::{self, Dim, array};
use crate::equations::Equations;
use crate::error::{OrRaise, batch, counts, exception, input, own};
use crate::gradient::{self, by_name};
use crate::interrupt::{Progress, ended, followed, long, short};
use crate::log;
use crate::mapping;
use crate::mesh::{Triangles, triangles};
use crate::objective::Objective;
use crate::policy::{self, Controller};
use crate::prepare::{Parts, Start, build, set_gains, warnings};
use crate::rollout::Rollout;
use crate::scene::{Scene, copied};
use crate::settings::{Keywords, row_or};
use crate::simulator::Simulator;
use crate::state::{Record, State};
use crate::tracking::Tracking;
use hydrograd::simulate::{Begin, Checkpoints, Halted, Member, Policy};
use hydrograd::{Controls, dynamics};
use nalgebra::{DMatrix, DVector};
use numpy::PyArrayDyn;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

impl Simulator {
    /// The controls that are given, or none for so many steps.
    fn controls(
        &self,
        place: &str,
        given: Option<&Bound<'_, PyAny>>,
        steps: Option<usize>,
    ) -> PyResult<Controls> {
        let n = self.controls_size();
        let Some(given) = given else {
            return Controls::none(&self.inner, steps.unwrap_or(self.scene.steps)).or_raise();
        };
        let shape = [Dim::Any("steps"), Dim::Is(n)];
        let found = array(&format!("{place}: controls"), given, &shape)?;
        if let Some(steps) = steps
            && steps != found.shape[0]
        {
            return Err(input(
                format!("{place}: steps"),
                steps,
                format!("must be {}, as the controls say", found.shape[0]),
            ));
        }
        Controls::from_matrix(&self.inner, found.columns(n)).or_raise()
    }

    /// The state where a run begins.
    fn begin(
        &self,
        state: Option<&Bound<'_, State>>,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Start> {
        if let Some(state) = state {
            if q.is_some() || v.is_some() {
                return Err(input(
                    "rollout: state",
                    "a state beside q or v",
                    "give one or the other",
                ));
            }
            return Ok(Start::At(state.clone().unbind()));
        }
        let (q0, v0) = self.inner.start();
        Ok(match (q, v) {
            (None, None) => Start::Scene,
            _ => Start::From(row_or("rollout: q", q, q0)?, row_or("rollout: v", v, v0)?),
        })
    }
}

/// The rollouts of a batch, if none failed.
fn gathered(
    of: &Bound<'_, Simulator>,
    made: Vec<Result<hydrograd::simulate::Rollout, Box<Halted>>>,
) -> PyResult<Vec<Rollout>> {
    let (py, count) = (of.py(), made.len());
    let errors = PyDict::new(py);
    let (mut first, mut foreign) = (None, None);
    let mut rollouts = Vec::with_capacity(count);
    for (b, one) in made.into_iter().enumerate() {
        let halted = match one {
            Ok(rollout) => {
                rollouts.push(Some(Rollout::new(of, rollout)));
                continue;
            }
            Err(halted) => *halted,
        };
        let error = exception(halted.error);
        let value = error.value(py);
        let (step, time) = (halted.step, halted.time);
        let place = format!("member {b} in step {step}, from t = {time} s on");
        if own(py, &error) {
            value.setattr("step", step)?;
            value.setattr("time", time)?;
            errors.set_item(b, value)?;
            first.get_or_insert_with(|| format!("{place}: {value}"));
        } else {
            foreign.get_or_insert((error, step, time, place));
        }
        rollouts.push(halted.rollout.map(|rollout| Rollout::new(of, rollout)));
    }
    if first.is_none() && foreign.is_none() {
        return Ok(rollouts.into_iter().flatten().collect());
    }
    let members = rollouts.into_iter();
    let members = members.map(|one| one.map(|one| Bound::new(py, one)).transpose());
    let members = members.collect::<PyResult<Vec<_>>>()?;
    // What a controller raised comes out as it is, with all that ran; what can't hold that comes out by itself.
    if let Some((error, step, time, place)) = foreign {
        let value = error.value(py);
        let _ = value.setattr("members", members);
        let _ = value.setattr("step", step);
        let _ = value.setattr("time", time);
        let _ = value.call_method1("add_note", (format!("rollout_batch: {place}"),));
        return Err(error);
    }
    let failed = errors.len();
    let first = first.unwrap_or_default();
    let message = format!("{failed} of {count} members failed, counted from 0; {first}");
    Err(batch(py, message, members.into_pyobject(py)?, errors))
}

impl Simulator {
    /// The thrusters on a body, given by number or name.
    fn thrusters_of(&self, body: &Bound<'_, PyAny>) -> PyResult<hydrograd::simulate::Allocation> {
        let names = self.inner.names();
        let number = match body.extract::<usize>() {
            Ok(number) => (number < names.len()).then_some(number),
            Err(_) => {
                let name = body.extract::<String>().ok();
                name.and_then(|name| names.iter().position(|n| *n == name))
            }
        };
        let number = number.ok_or_else(|| {
            input(
                "allocation: body",
                body.to_string(),
                format!(
                    "must be a number under {}, or one of {names:?}",
                    names.len()
                ),
            )
        })?;
        self.inner.allocation(number).or_raise()
    }
}

#[pymethods]
impl Simulator {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.policy)
    }

    #[new]
    #[pyo3(signature = (
        scene, dt=None, *, fidelity=None, method=None, tolerance=None, integrator=None, faces=None, accuracy=None,
        rank=None, resolved_gap=None, films=None, exchange=None, shape_parameters=None, cache=None, backend=None
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "one per keyword of the constructor"
    )]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, Scene>,
        dt: Option<f64>,
        fidelity: Option<&str>,
        method: Option<&str>,
        tolerance: Option<f64>,
        integrator: Option<&str>,
        #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
        accuracy: Option<f64>,
        #[pyo3(from_py_with = counts::optional::rank)] rank: Option<usize>,
        resolved_gap: Option<f64>,
        films: Option<bool>,
        exchange: Option<&str>,
        shape_parameters: Option<Vec<String>>,
        cache: Option<PathBuf>,
        backend: Option<&str>,
    ) -> PyResult<Self> {
        let keywords = Keywords {
            dt,
            fidelity,
            method,
            tolerance,
            integrator,
            faces,
            accuracy,
            rank,
            resolved_gap,
            films,
            exchange,
            shape_parameters,
            backend,
        };
        let scene = copied(scene)?;
        let choices = keywords.settings()?.resolve(&scene);
        build(py, scene, choices, cache)
    }

    /// Runs the scene, with its own controller if it has one, and `controls` (steps, control_size) added to it: generalised
    /// forces of actuated joints and wrenches on bodies, N and N m, and commands of thrusters. Without them, `steps` (default: the scene's) without
    /// control. It begins where the simulator does unless given a `state`, or `q` (q_size,) and `v` (v_size,). Ctrl-C ends it.
    ///
    /// `progress(done, total)` is called with the steps made, at most twenty times a second and once at the end. What it raises ends the run and comes out.
    /// An error that ends the run has the rollout of the steps that were made as its `rollout`, whether progress raised it or a step did; the latter's has
    /// the `step` and the `time` (s) as well.
    #[pyo3(signature = (controls=None, *, steps=None, state=None, q=None, v=None, progress=None))]
    fn rollout(
        slf: &Bound<'_, Self>,
        controls: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = counts::optional::steps)] steps: Option<usize>,
        state: Option<&Bound<'_, State>>,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Rollout> {
        let me = slf.get();
        let start = me.begin(state, q, v)?;
        let controls = me.controls("rollout", controls, steps)?;
        let (py, steps) = (slf.py(), controls.steps());
        let mut progress = Progress::new("rollout: progress", progress, steps)?;
        let inner = me.inner.clone();
        let started = Instant::now();
        let made = followed(py, &mut progress, move |interrupt| {
            let state = start.state(&inner)?;
            Ok(inner.rollout_as_far(&state, &controls, |done| interrupt.at(done)))
        })?;
        let with = |raised: PyErr, partial: Option<hydrograd::Rollout>| -> PyResult<PyErr> {
            if let Some(partial) = partial {
                // Where an exception takes no attributes it comes out without.
                let partial = Bound::new(py, Rollout::new(slf, partial))?;
                let _ = raised.value(py).setattr("rollout", partial);
            }
            Ok(raised)
        };
        let made = match (progress.and_then(|progress| progress.raised), made) {
            (Some(raised), Ok(rollout)) => return Err(with(raised, Some(rollout))?),
            (Some(raised), Err(halted)) => return Err(with(raised, halted.rollout)?),
            (None, Ok(rollout)) => rollout,
            (None, Err(halted)) => {
                let raised = exception(halted.error);
                let value = raised.value(py);
                let _ = value.setattr("step", halted.step);
                let _ = value.setattr("time", halted.time);
                return Err(with(raised, halted.rollout)?);
            }
        };
        log::done(py, started, || format!("rollout: {steps} steps"))?;
        log::warnings(py, "rollout", || made.warnings())?;
        Ok(Rollout::new(slf, made))
    }

    /// Runs many controls, (batch, steps, control_size), on all cores: the same rollouts, to the bit, as one after the other. With the backend gpu and the fidelity
    /// reduced the couplings of all are computed together: a member is the same, to the bit, whoever runs beside it.
    /// `q` (batch, q_size) and `v` (batch, v_size) are where each begins, if given. Where some fail, the `BatchError` has what ran and each one's error.
    ///
    /// `progress(done, total)` is called with the steps made by all members together, as in `rollout`; what it raises comes out with all of the batch,
    /// each member as far as it came, as its `members`.
    #[pyo3(signature = (controls, *, q=None, v=None, progress=None))]
    fn rollout_batch(
        slf: &Bound<'_, Self>,
        controls: &Bound<'_, PyAny>,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Rollout>> {
        let me = slf.get();
        let n = me.controls_size();
        let found = array(
            "rollout_batch: controls",
            controls,
            &[Dim::Any("batch"), Dim::Any("steps"), Dim::Is(n)],
        )?;
        let (batch, steps) = (found.shape[0], found.shape[1]);
        let (q0, v0) = me.inner.start();
        let each = |place: &str, given: Option<&Bound<'_, PyAny>>, default: &DVector<f64>| {
            let Some(given) = given else {
                return Ok(vec![default.clone(); batch]);
            };
            let found = array(place, given, &[Dim::Is(batch), Dim::Is(default.len())])?;
            let rows =
                (0..batch).map(|b| &found.values[b * default.len()..(b + 1) * default.len()]);
            PyResult::Ok(rows.map(DVector::from_column_slice).collect())
        };
        let starts: Vec<Start> = match (q, v) {
            (None, None) => (0..batch).map(|_| Start::Scene).collect(),
            _ => {
                let q = each("rollout_batch: q", q, q0)?;
                let v = each("rollout_batch: v", v, v0)?;
                q.into_iter()
                    .zip(v)
                    .map(|(q, v)| Start::From(q, v))
                    .collect()
            }
        };
        let size = n * steps;
        let runs: Vec<(Start, DMatrix<f64>)> = starts
            .into_iter()
            .enumerate()
            .map(|(b, start)| {
                let values = &found.values[b * size..(b + 1) * size];
                (start, DMatrix::from_column_slice(n, steps, values))
            })
            .collect();
        let inner = me.inner.clone();
        let py = slf.py();
        let mut progress = Progress::new("rollout_batch: progress", progress, batch * steps)?;
        let started = Instant::now();
        let made = followed(py, &mut progress, move |interrupt| {
            let member = |(start, matrix): (Start, DMatrix<f64>)| {
                let controls = Controls::from_matrix(&inner, matrix)?;
                let begin = match start {
                    Start::Scene => Begin::Scene,
                    Start::From(q, v) => Begin::At(q, v),
                    Start::At(state) => Begin::State(state.get().of(&inner)?),
                };
                hydrograd::Result::Ok(Member { begin, controls })
            };
            let (mut members, mut refused) = (Vec::with_capacity(runs.len()), Vec::new());
            for (b, run) in runs.into_iter().enumerate() {
                match member(run) {
                    Ok(member) => members.push(member),
                    Err(error) => refused.push((b, error)),
                }
            }
            let (mut made, _) = inner.rollout_batch(&members, || interrupt.one_more())?;
            // In order, so that each stands in its own place.
            for (b, error) in refused {
                let (step, time, rollout) = (0, 0.0, None);
                made.insert(
                    b,
                    Err(Box::new(Halted {
                        step,
                        time,
                        error,
                        rollout,
                    })),
                );
            }
            Ok(made)
        })?;
        if let Some(raised) = progress.and_then(|progress| progress.raised) {
            let ran = made
                .into_iter()
                .map(|one| one.map_or_else(|halted| halted.rollout, Some))
                .map(|one| {
                    one.map(|one| Bound::new(py, Rollout::new(slf, one)))
                        .transpose()
                })
                .collect::<PyResult<Vec<_>>>()?;
            let _ = raised.value(py).setattr("members", ran);
            return Err(raised);
        }
        log::done(py, started, || {
            format!("rollout_batch: {batch} members of {steps} steps")
        })?;
        for (member, one) in made.iter().enumerate() {
            if let Ok(one) = one {
                log::warnings(py, &format!("rollout_batch: member {member}"), || {
                    one.warnings()
                })?;
            }
        }
        gathered(slf, made)
    }

    /// Gradients of an `objective` of many rollouts of this simulator, one reverse sweep each, on all cores: those of `Rollout.gradient`, with the backend gpu
    /// computed together as `rollout_batch` computes the rollouts. `progress(done, total)` is called with the steps gone back by all of them together; what it raises ends the
    /// sweeps and comes out. Ctrl-C ends them.
    #[pyo3(signature = (rollouts, objective, *, progress=None))]
    fn gradient_batch<'py>(
        &self,
        py: Python<'py>,
        rollouts: Vec<PyRef<'py, Rollout>>,
        objective: PyRef<'py, Objective>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let all: Vec<_> = rollouts.iter().map(|rollout| rollout.shared()).collect();
        let steps = all.iter().map(|rollout| rollout.steps()).sum();
        let (inner, objective) = (self.inner.clone(), objective.0.clone());
        let mut progress = Progress::new("gradient_batch: progress", progress, steps)?;
        let made = followed(py, &mut progress, move |interrupt| {
            let all: Vec<&hydrograd::Rollout> = all.iter().map(Arc::as_ref).collect();
            let (made, _) = inner.gradient_batch(&all, &objective, || interrupt.one_more())?;
            made.into_iter().collect::<hydrograd::Result<Vec<_>>>()
        });
        let made = ended(progress, made)?;
        made.iter()
            .map(|one| gradient::of_rollout(py, one))
            .collect()
    }

    /// Value and gradient of an `objective` of a run with `controls` (steps, control_size), or of `steps` steps, from where the simulator starts, within `memory` (bytes) for what is
    /// kept of the run: a rollout keeps some kilobytes a step, which is too much for 10⁵ steps and more. Parts of it run again, so it takes longer; the gradient is that of the
    /// rollout, to rounding. Observables that are means over steps are refused. `progress(done, total)` is called with the parts done,
    /// as in `rollout`; what it raises ends the work and comes out. Ctrl-C ends it.
    #[pyo3(signature = (objective, controls=None, *, steps=None, memory=1e8, progress=None))]
    fn gradient_in_parts<'py>(
        &self,
        py: Python<'py>,
        objective: PyRef<'_, Objective>,
        controls: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = counts::optional::steps)] steps: Option<usize>,
        memory: f64,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(f64, Bound<'py, PyAny>)> {
        let controls = self.controls("gradient_in_parts", controls, steps)?;
        let (inner, objective) = (self.inner.clone(), objective.0.clone());
        let kept = Checkpoints::within(&inner, controls.steps(), memory).or_raise()?;
        let total = kept.work(controls.steps());
        let mut progress = Progress::new("gradient_in_parts: progress", progress, total)?;
        let made = followed(py, &mut progress, move |interrupt| {
            inner.gradient_in_parts(&controls, &objective, kept, |done| interrupt.at(done))
        });
        let made = ended(progress, made)?;
        Ok((made.value, gradient::of_rollout(py, &made.gradient)?))
    }

    /// The state at coordinates `q` (q_size,) and generalised velocity `v` (v_size,) after `step` steps; what is None is
    /// where the simulator starts, with joints that a motion drives where that has them then. `mode` is what the scene's controller remembers, `held` (bodies,) whose joints it held in the
    /// step that led here, by default none.
    #[pyo3(signature = (q=None, v=None, *, step=0, mode=0, held=None))]
    fn state(
        slf: &Bound<'_, Self>,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = counts::step)] step: usize,
        #[pyo3(from_py_with = counts::mode)] mode: usize,
        held: Option<Vec<bool>>,
    ) -> PyResult<State> {
        let me = slf.get();
        let bodies = me.inner.system().len();
        let held = held.unwrap_or_default();
        if ![0, bodies].contains(&held.len()) {
            return Err(input(
                "state: held",
                format!("{} numbers", held.len()),
                format!("must be {bodies}, one a body"),
            ));
        }
        let (q0, v0) = me.inner.start();
        let row = |place: &str, given: Option<&Bound<'_, PyAny>>, default: &DVector<f64>| {
            given
                .map(|given| row_or(place, Some(given), default))
                .transpose()
        };
        let (q, v) = (row("state: q", q, q0)?, row("state: v", v, v0)?);
        let (made, v) = short(slf.py(), || {
            let (q, v) = me.inner.placed(step, q.as_ref(), v.as_ref())?;
            Ok((me.inner.state(step, &q, &v)?, v))
        })?;
        let state = dynamics::State { held, mode, ..made };
        Ok(State {
            simulator: slf.clone().unbind(),
            state,
            velocity: v,
        })
    }

    /// One step from a state with the controls `u` (control_size,), N and N m: the next state, and the record that has the
    /// step's derivatives. The steps of a rollout, to the bit.
    #[pyo3(signature = (state, u=None))]
    fn step(
        slf: &Bound<'_, Self>,
        state: &Bound<'_, State>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(State, Record)> {
        let me = slf.get();
        let n = me.controls_size();
        let control = match u {
            Some(u) => array("step: u", u, &[Dim::Is(n)])?.values.into(),
            None => DVector::zeros(n),
        };
        let from = state.get();
        let (state, record) = short(slf.py(), || me.inner.step(&from.of(&me.inner)?, &control))?;
        let next = State {
            simulator: slf.clone().unbind(),
            state,
            velocity: record.rollout().samples()[1].v.clone(),
        };
        Ok((next, Record(Arc::new(record), slf.clone().unbind())))
    }

    /// The equations of motion at the coordinates `q` (q_size,), or at many (N, q_size); default: where the simulator starts. Currents are as they are at `time` (s).
    #[pyo3(signature = (q=None, *, time=0.0))]
    fn equations(
        slf: &Bound<'_, Self>,
        q: Option<&Bound<'_, PyAny>>,
        time: f64,
    ) -> PyResult<Equations> {
        Equations::new(slf, q, time)
    }

    /// q ⊕ ξ: the configurations that `q` (…, q_size) become by the tangents `xi` (…, v_size); of rotations a rotation vector, rad, in the joint's frame.
    fn integrate<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        xi: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.integrated(q, xi)
    }

    /// The tangents (…, v_size) by which `integrate` gets from the configurations `start` (…, q_size) to `end`; of rotations the shorter way.
    fn difference<'py>(
        &self,
        start: &Bound<'py, PyAny>,
        end: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.differing(start, end)
    }

    /// The linearisation x₁ ≈ A x₀ + B u of one step in x = (q, v), coordinates in their tangent space, from the states `q` (…, q_size), `v` (…, v_size) and controls
    /// `u` (…, control_size): A (…, 2 v_size, 2 v_size) and B (…, 2 v_size, control_size), on all cores. What is None is where the simulator starts, with joints that a motion drives where that has them
    /// then, and no control. `step` is the number of the step, and so the time, of motions and currents.
    #[pyo3(signature = (q=None, v=None, u=None, *, step=0))]
    fn linearise<'py>(
        &self,
        py: Python<'py>,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
        u: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = counts::step)] step: usize,
    ) -> PyResult<Bound<'py, PyTuple>> {
        self.linearised(py, [q, v, u], step)
    }

    /// Holds the gradient of a rollout of `steps` steps (the scene's number by default) against central differences, along so many random `directions` in each group (controls,
    /// initial state, parameters, gains), and says by how much the trajectory magnifies small changes. A dictionary: "max_rel_error", the largest over all directions of the smallest
    /// error over the "step_sizes"; "rel_error_controls", "rel_error_initial", "rel_error_parameters"; "directions", each with its numbers; "growth", and "advice" where that is
    /// large. How small an error can be seen goes with the simulator's `tolerance`: with "full" use 1e-12. Ctrl-C ends it.
    #[pyo3(signature = (steps=None, *, directions=4, seed=0))]
    fn gradcheck<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = counts::optional::steps)] steps: Option<usize>,
        #[pyo3(from_py_with = counts::directions)] directions: usize,
        #[pyo3(from_py_with = counts::seed)] seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        crate::gradcheck::check(
            py,
            self,
            steps.unwrap_or(self.scene.steps),
            directions,
            seed,
        )
    }

    /// Added mass of the bodies in the water at the start, (6 n, 6 n), world axes: per body three rows of force per acceleration of
    /// its origin, then three of torque per angular acceleration; kg, kg m, kg m².
    fn added_mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let inner = self.inner.clone();
        let made = long(py, move |_| inner.added_mass())?;
        array::matrix(py, &made.matrix)
    }

    /// The same with other physical parameters, by name as in `parameters`; what isn't named stays. It shares what was
    /// prepared, so it costs next to nothing.
    fn with_parameters(&self, changes: &Bound<'_, PyAny>) -> PyResult<Self> {
        let changes = mapping::named("with_parameters", "a number", Some(changes))?;
        self.changed(|inner| {
            let mut parameters = inner.parameters().clone();
            for (name, value) in &changes {
                parameters.set(name, *value)?;
            }
            inner.set_parameters(parameters)
        })
    }

    /// The same with another start: coordinates `q` (q_size,) and generalised velocity `v` (v_size,). Bodies must be apart there, as at any start; of a
    /// joint that a motion drives both are what the motion says: 0, or that.
    #[pyo3(signature = (q=None, v=None))]
    fn with_start(
        &self,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (q0, v0) = self.inner.start();
        let (q, v) = (
            row_or("with_start: q", q, q0)?,
            row_or("with_start: v", v, v0)?,
        );
        self.changed(|inner| inner.set_start(q, v))
    }

    /// The same with a controller of your own in place of the scene's: an object with `act(observation)`, which gives the controls
    /// (control_size,), and, for gradients, `act_vjp`: see `hydrograd.Policy`. It is called once a step, and once a step of the
    /// reverse sweep, with the interpreter's lock.
    pub fn with_policy(&self, policy: &Bound<'_, PyAny>) -> PyResult<Self> {
        let sizes = (self.controls_size(), self.v_size());
        let controller: Box<dyn Policy> = match policy.cast::<Tracking>() {
            // Without a detour over Python.
            Ok(tracking) => Box::new(tracking.get().inner.clone()),
            Err(_) => Box::new(Controller::new(policy, sizes)?),
        };
        let mut out = self.changed(|inner| {
            inner.set_policy(controller);
            Ok(())
        })?;
        out.policy = Some(policy.clone().unbind());
        Ok(out)
    }

    /// The same with contact that sets in over `factor` times its width, with a stiffness `factor` times smaller: what a descent starts on and
    /// hardens (`hydrograd.optimize.continuation`). Nothing changes where nothing touches.
    fn with_soft_contact(&self, factor: f64) -> PyResult<Self> {
        self.softened(factor)
    }

    /// The same with other gains of its controller, (gains,).
    fn with_gains(&self, gains: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Some(policy) = &self.policy {
            let (given, own) = (
                array::row("with_gains: gains", gains)?,
                self.inner.policy().gains(),
            );
            if given.len() != own.len() {
                return Err(input(
                    "with_gains: gains",
                    format!("{} numbers", given.len()),
                    format!(
                        "must be {} numbers, as many as the controller has",
                        own.len()
                    ),
                ));
            }
            return self.with_policy(&policy::with_gains(policy.bind(gains.py()), gains)?);
        }
        let gains = array::row("with_gains: gains", gains)?;
        self.changed(|inner| set_gains(inner, &gains))
    }

    /// Its controller, if that is written in Python.
    #[getter]
    fn policy(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.policy.as_ref().map(|p| p.clone_ref(py))
    }

    /// Gains of its controller, (gains,); none without one.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let gains = self.inner.policy().gains();
        let n = gains.len();
        array::to_python(py, gains, &[n])
    }

    /// The physical parameters by name: density, masses, inertias, drag and contact, SI units.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        by_name(py, self.inner.parameters())
    }

    /// Coordinates at the start, (q_size,).
    #[getter]
    fn initial_q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let q = self.inner.start().0;
        array::to_python(py, q.as_slice().to_vec(), &[q.len()])
    }

    /// Generalised velocity at the start, (v_size,).
    #[getter]
    fn initial_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let v = self.inner.start().1;
        array::to_python(py, v.as_slice().to_vec(), &[v.len()])
    }

    /// The scene that it was made from.
    #[getter]
    fn scene(&self) -> Scene {
        Scene(self.scene.clone())
    }

    /// Time step, s.
    #[getter]
    fn dt(&self) -> f64 {
        self.inner.time_step()
    }

    /// Number of controls a step.
    #[getter]
    fn control_size(&self) -> usize {
        self.controls_size()
    }

    /// Names of the controls, in order: "arm.force.rate" does work on the velocity "arm.rate", "arm.target.angle" is where a servo shall bring "arm.angle", "hull.wrench.fx", …
    /// "hull.wrench.mz" are a body's wrench, and a thruster's command has the thruster's name.
    #[getter]
    fn control_names(&self) -> Vec<String> {
        self.inner.control_names()
    }

    /// Units of the controls, in order: "N", "N m", of servos' targets "m" or "rad", of a thruster's rotor "rad/s", "1" of what scales or curves make something else of.
    #[getter]
    fn control_units(&self) -> Vec<&'static str> {
        self.inner.control_units()
    }

    /// Names of the joint coordinates, in order: "coin.y", "arm.angle", …
    #[getter]
    fn coordinate_names(&self) -> Vec<String> {
        self.inner.scene().coordinate_labels()
    }

    /// Names of the generalised velocities, in order: "coin.vy", "arm.rate", …
    #[getter]
    fn velocity_names(&self) -> Vec<String> {
        self.inner.scene().velocity_labels()
    }

    /// The allocation matrix (6, n) of the thrusters on a `body` (number or name), in the order in which they were added: the wrench of a newton of thrust on the body,
    /// its frame, about its origin, linear part first (1, m).
    fn allocation<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let found = self.thrusters_of(body)?;
        let rows = found.matrix.transpose();
        array::to_python(py, rows.as_slice().to_vec(), &[6, found.controls.len()])
    }

    /// The controls (numbers) of the thrusters on a `body` (number or name), in the order of the columns of `allocation`.
    fn thruster_controls(&self, body: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        Ok(self.thrusters_of(body)?.controls)
    }

    /// Number of joint coordinates q.
    #[getter]
    fn q_size(&self) -> usize {
        self.inner.system().tree.coordinates()
    }

    /// Number of generalised velocities v.
    #[getter]
    fn v_size(&self) -> usize {
        self.inner.system().tree.velocities()
    }

    /// The bodies' surfaces, as gaps are measured between them, each in its body's frame: vertices (n, 3) in m and faces (m, 3)
    /// of vertex numbers; None for a body without a shape.
    fn meshes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Option<Triangles<'py>>>> {
        let inner = self.inner.clone();
        let made = long(py, move |_| inner.meshes())?;
        let meshes = made.iter();
        meshes
            .map(|mesh| mesh.as_ref().map(|m| triangles(py, m)).transpose())
            .collect()
    }

    /// Names of the bodies, in order.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.inner.names()
    }

    /// Names of the entries of q.
    #[getter]
    fn q_names(&self) -> Vec<String> {
        self.scene.coordinate_labels()
    }

    /// Names of the entries of v.
    #[getter]
    fn v_names(&self) -> Vec<String> {
        self.scene.velocity_labels()
    }

    /// The fidelity in use: what was asked for, or what "auto" chose.
    #[getter]
    fn fidelity(&self) -> &'static str {
        self.inner.fidelity().into()
    }

    /// What computes the coupling: "cpu" or "gpu".
    #[getter]
    fn backend(&self) -> &'static str {
        self.inner.backend().backend_used.into()
    }

    /// The integrator.
    #[getter]
    fn integrator(&self) -> &'static str {
        self.inner.choices().integrator.into()
    }

    /// What was chosen, and why: by "auto", and of an integrator that stands in for the default, which doesn't solve contact.
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.inner.reasons().to_vec()
    }

    /// The gaps at which surfaces are taken to touch, m, by pair of names: of two bodies, or of one and None for a wall. Empty where the scene
    /// has no contact.
    #[getter]
    fn contact_gaps(&self) -> HashMap<(String, Option<String>), f64> {
        let names = self.inner.names();
        let gaps = self.inner.contact_gaps().into_iter();
        gaps.map(|g| {
            (
                (
                    names[g.first].to_string(),
                    g.second.map(|b| names[b].to_string()),
                ),
                g.gap,
            )
        })
        .collect()
    }

    /// What should be known about the scene and its start, with names and numbers.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        short(py, || Ok(warnings(&self.inner)))
    }

    fn __repr__(&self) -> String {
        format!(
            "Simulator(bodies={:?}, dt={:?} s, fidelity={:?}, integrator={:?})",
            self.inner.names(),
            self.dt(),
            self.fidelity(),
            self.integrator()
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_simulator")?;
        let choices = serde_json::to_string(self.inner.choices()).map_err(|e| {
            input(
                "simulator: choices",
                e,
                "must be numbers that JSON can hold",
            )
        })?;
        let (q, v) = self.inner.start();
        let list = |x: &DVector<f64>| x.as_slice().to_vec();
        let policy = self.policy(py);
        let gains = match policy {
            Some(_) => Vec::new(),
            None => self.inner.policy().gains(),
        };
        let start = (list(q), list(v), gains);
        let parameters = self.inner.parameters().to_vec();
        let scene = self.scene.to_toml().or_raise()?;
        Ok((
            make,
            (
                scene,
                choices,
                self.cache.clone(),
                parameters,
                start,
                policy,
                self.softness,
            ),
        ))
    }
}
