//! The pressure of the water on bodies at a state.

use crate::array;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::simulate;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

/// Pressure of the water on the faces of one body at one state, by Bernoulli's law for unsteady flow, from the accelerations there: made by `Rollout.pressure`. World frame. With
/// `pressures`, −Σ p n A is what `Rollout.loads` calls "water", in a force `current` with what it calls "current", to the error of the faces.
#[pyclass(frozen, module = "hydrograd")]
pub struct SurfacePressure(pub simulate::SurfacePressure);

type Numbers<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;

fn vectors<'py>(py: Python<'py>, rows: &[Vec3]) -> Numbers<'py> {
    let values = rows.iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    array::to_python(py, values, &[rows.len(), 3])
}

fn numbers<'py>(py: Python<'py>, row: &[f64]) -> Numbers<'py> {
    array::to_python(py, row.to_vec(), &[row.len()])
}

#[pymethods]
impl SurfacePressure {
    /// The body's name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Centroids of the faces (n, 3), m.
    #[getter]
    fn centres<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        vectors(py, &self.0.centres)
    }

    /// Unit normals of the faces into the water (n, 3).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        vectors(py, &self.0.normals)
    }

    /// Areas of the faces (n,), m².
    #[getter]
    fn areas<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, &self.0.areas)
    }

    /// Velocity of the water at the centroids (n, 3), m/s; a current is in it.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        vectors(py, &self.0.velocities)
    }

    /// Pressure of the flow at the centroids (n,), Pa, zero far away.
    #[getter]
    fn pressures<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, &self.0.pressures)
    }

    /// Pressure of the water at rest (n,), Pa: zero at the world's origin, or under a `waterline` at the water's surface and all above it; of a face that reaches through it the mean over the face.
    #[getter]
    fn hydrostatic<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, &self.0.hydrostatic)
    }

    /// How much of each face lies at a gap that a film carries (n,), in parts of it.
    #[getter]
    fn at_films<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, &self.0.at_films)
    }

    /// Force and moment about the body's origin of `pressures` (6,), N and N m, world axes.
    #[getter]
    fn wrench<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, self.0.wrench().as_slice())
    }

    /// The same of `hydrostatic`: buoyancy of the closed surface, of what of it is below a `waterline`.
    #[getter]
    fn hydrostatic_wrench<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        numbers(py, self.0.hydrostatic_wrench().as_slice())
    }
}
