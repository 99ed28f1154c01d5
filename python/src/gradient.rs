//! Gradients for Python: instances of the data classes in `hydrograd/_gradient.py`.

use crate::array;
use hydrograd::dynamics::Parameters;
use nalgebra::DVector;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("hydrograd._gradient")?.getattr(name)
}

fn vector<'py>(py: Python<'py>, v: &DVector<f64>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array::to_python(py, v.as_slice().to_vec(), &[v.len()])
}

/// The parameters by name.
pub fn by_name<'py>(py: Python<'py>, parameters: &Parameters) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for (name, value) in parameters.names().zip(parameters.to_vec()) {
        out.set_item(name, value)?;
    }
    Ok(out)
}

/// The gradient of a rollout.
pub fn of_rollout<'py>(
    py: Python<'py>,
    gradient: &hydrograd::Gradient,
) -> PyResult<Bound<'py, PyAny>> {
    let controls = array::transposed(py, &gradient.controls, &[gradient.controls.nrows()])?;
    let parts = (
        controls,
        vector(py, &gradient.initial.q)?,
        vector(py, &gradient.initial.v)?,
        by_name(py, &gradient.parameters)?,
        array::to_python(py, gradient.gains.clone(), &[gradient.gains.len()])?,
        gradient.warnings.clone(),
    );
    class(py, "Gradient")?.call1(parts)
}

/// The gradient of one step.
pub fn of_step<'py>(
    py: Python<'py>,
    gradient: &hydrograd::Gradient,
) -> PyResult<Bound<'py, PyAny>> {
    let controls = gradient.controls.column(0).into_owned();
    let parts = (
        vector(py, &gradient.initial.q)?,
        vector(py, &gradient.initial.v)?,
        vector(py, &controls)?,
        by_name(py, &gradient.parameters)?,
        array::to_python(py, gradient.gains.clone(), &[gradient.gains.len()])?,
    );
    class(py, "StepGradient")?.call1(parts)
}
