//! What simulators run: rollouts, many at once, and gradients of runs too long to keep.

use crate::array::{Dim, array};
use crate::error::{OrRaise, batch, counts, exception, input, own};
use crate::gradient;
use crate::interrupt::{Progress, ended, followed};
use crate::log;
use crate::objective::Objective;
use crate::prepare::Start;
use crate::rollout::Rollout;
use crate::settings::row_or;
use crate::simulator::Simulator;
use crate::state::State;
use hydrograd::Controls;
use hydrograd::simulate::{Begin, Checkpoints, Halted, Member};
use nalgebra::{DMatrix, DVector};
use pyo3::prelude::*;
use pyo3::types::PyDict;
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

#[pymethods]
impl Simulator {
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
}
