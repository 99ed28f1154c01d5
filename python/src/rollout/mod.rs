//! Rollouts: trajectories with the key to their gradients.

mod derivatives;
mod files;
mod states;
mod water;

use crate::array;
use crate::contact;
use crate::error::input;
use crate::interrupt::short;
use crate::loads::Loads;
use crate::simulator::Simulator;
use crate::state::State;
use numpy::PyArrayDyn;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::Arc;

/// A trajectory of states 0 … N: the forward pass, and the only key to its gradient. Each access to an array makes a new one.
#[pyclass(frozen, module = "hydrograd")]
pub struct Rollout {
    simulator: Py<Simulator>,
    inner: Arc<hydrograd::Rollout>,
}

/// An array of numbers.
type Numbers<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;

impl Rollout {
    /// What it shows.
    pub fn shared(&self) -> Arc<hydrograd::Rollout> {
        self.inner.clone()
    }

    /// A rollout of a simulator.
    pub fn new(simulator: &Bound<'_, Simulator>, inner: hydrograd::Rollout) -> Self {
        Self {
            simulator: simulator.clone().unbind(),
            inner: Arc::new(inner),
        }
    }

    fn bodies(&self) -> usize {
        self.inner.simulator().system().len()
    }
}

#[pymethods]
impl Rollout {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    /// The simulator that made it.
    #[getter]
    fn simulator(&self, py: Python<'_>) -> Py<Simulator> {
        self.simulator.clone_ref(py)
    }

    /// Number of steps N.
    #[getter]
    fn steps(&self) -> usize {
        self.inner.steps()
    }

    /// What should be known about this trajectory, with names and numbers.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        short(py, || Ok(self.inner.warnings()))
    }

    /// The state after `step` steps, from which a run may go on; negative numbers count from the end.
    #[pyo3(signature = (step=-1), text_signature = "($self, step=-1)")]
    fn state(&self, py: Python<'_>, step: isize) -> PyResult<State> {
        let at = array::numbered(step, self.inner.states().len(), "state")?;
        Ok(State {
            simulator: self.simulator.clone_ref(py),
            state: self.inner.states()[at].clone(),
            velocity: self.inner.samples()[at].v.clone(),
        })
    }

    /// Contacts during the step from state `step` to the next, at the pose of that state: where surfaces are no more than `slack` (m)
    /// farther apart than the gap at which they touch, and what presses there. None where the scene has no contact. Negative
    /// numbers count from the end: -1 is the last step.
    #[pyo3(signature = (step, slack=0.0))]
    fn contacts<'py>(
        &self,
        py: Python<'py>,
        step: isize,
        slack: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        if !(slack.is_finite() && slack >= 0.0) {
            return Err(input(
                "contacts: slack",
                slack,
                "must be finite and not negative, in m",
            ));
        }
        let at = array::numbered(step, self.steps(), "step")?;
        let found = short(py, || self.inner.contacts(at, slack))?;
        contact::of_step(py, &found)
    }

    /// What acts on every body and across every joint at state `state`, as the step there starts: gravity, buoyancy, drag, thrust, the inertia of the water, contact. Negative
    /// numbers count from the end.
    ///
    /// At the last state (-1) no step begins: no control acts, nothing touches and no joint's stop presses, so that what lay or was held accelerates there. What presses at the end
    /// of a run is that of state -2.
    fn loads(&self, py: Python<'_>, state: isize) -> PyResult<Loads> {
        let at = array::numbered(state, self.inner.states().len(), "state")?;
        short(py, || self.inner.loads(at)).map(Loads)
    }

    fn __len__(&self) -> usize {
        self.inner.states().len()
    }

    fn __repr__(&self) -> String {
        format!(
            "Rollout(steps={}, bodies={:?})",
            self.steps(),
            self.inner.simulator().names()
        )
    }

    /// Run again where it is unpickled: its simulator, where it began, and the controls.
    #[expect(clippy::type_complexity, reason = "what pickle asks for")]
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (Py<Simulator>, State, Bound<'py, PyArrayDyn<f64>>),
    )> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_rollout")?;
        Ok((
            make,
            (
                self.simulator.clone_ref(py),
                self.state(py, 0)?,
                self.controls(py)?,
            ),
        ))
    }
}
