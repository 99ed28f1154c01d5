//! What simulators know of one state: a step, its derivatives, the equations of motion there.

use crate::array::{self, Dim, array};
use crate::equations::Equations;
use crate::error::{counts, input};
use crate::interrupt::{long, short};
use crate::settings::row_or;
use crate::simulator::Simulator;
use crate::state::{Record, State};
use hydrograd::dynamics;
use nalgebra::DVector;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::Arc;

#[pymethods]
impl Simulator {
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
}
