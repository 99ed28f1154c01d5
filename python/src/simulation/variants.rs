//! Simulators like another one but for something, and what may be changed.

use crate::array;
use crate::error::input;
use crate::gradient::by_name;
use crate::mapping;
use crate::policy::{self, Controller};
use crate::prepare::set_gains;
use crate::settings::row_or;
use crate::simulator::Simulator;
use crate::tracking::Tracking;
use hydrograd::simulate::Policy;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[pymethods]
impl Simulator {
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
    pub(super) fn policy(&self, py: Python<'_>) -> Option<Py<PyAny>> {
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
}
