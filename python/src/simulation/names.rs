//! What simulators tell of controls, coordinates and bodies: numbers, names and units.

use crate::array;
use crate::error::{OrRaise, input};
use crate::interrupt::long;
use crate::mesh::{Triangles, triangles};
use crate::simulator::Simulator;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

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
    /// Time step, s.
    #[getter]
    pub(super) fn dt(&self) -> f64 {
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
    pub(super) fn v_size(&self) -> usize {
        self.inner.system().tree.velocities()
    }

    /// Names of the entries of q, the joint coordinates, in order: "coin.y", "arm.angle", …
    #[getter]
    fn q_names(&self) -> Vec<String> {
        self.scene.coordinate_labels()
    }

    /// Names of the entries of v, the generalised velocities, in order: "coin.vy", "arm.rate", …
    #[getter]
    fn v_names(&self) -> Vec<String> {
        self.scene.velocity_labels()
    }

    /// Names of the bodies, in order.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.inner.names()
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
}
