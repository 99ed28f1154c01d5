//! Contacts for Python: instances of the data class in `hydrograd/_contacts.py`.

use crate::array;
use hydrograd::dynamics::ContactForce;
use numpy::PyArray1;
use pyo3::prelude::*;

/// The contacts of one step.
pub fn of_step<'py>(py: Python<'py>, found: &[ContactForce]) -> PyResult<Bound<'py, PyAny>> {
    let n = found.len();
    let numbers =
        |of: fn(&ContactForce) -> i64| PyArray1::from_vec(py, found.iter().map(of).collect());
    let vectors = |of: fn(&ContactForce) -> [f64; 3]| {
        array::to_python(py, found.iter().flat_map(of).collect(), &[n, 3])
    };
    let parts = (
        numbers(|c| c.first as i64),
        numbers(|c| c.second.map_or(-1, |b| b as i64)),
        vectors(|c| c.position)?,
        vectors(|c| c.normal)?,
        array::to_python(py, found.iter().map(|c| c.gap).collect(), &[n])?,
        vectors(|c| c.force)?,
    );
    py.import("hydrograd._contacts")?
        .getattr("ContactForces")?
        .call1(parts)
}
