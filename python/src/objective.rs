//! Objectives: weighted sums of terms of a trajectory.

use crate::array::fixed;
use crate::error::{counts, input};
use crate::flow::{sensor, which};
use hydrograd::objective::{self, Sum};
use pyo3::prelude::*;

/// A scalar of a rollout: made by the functions of `hydrograd.objective`, added with `+`, `-` and `sum`, and weighted with `*` and `/`.
#[pyclass(frozen, module = "hydrograd.objective")]
#[derive(Clone)]
pub struct Objective(pub Sum);

#[pymethods]
impl Objective {
    fn __add__(&self, other: PyRef<'_, Self>) -> Self {
        Self(self.0.clone() + other.0.clone())
    }

    /// `sum` of objectives begins with 0.
    fn __radd__(&self, other: f64) -> PyResult<Self> {
        match other {
            0.0 => Ok(self.clone()),
            other => Err(input(
                "objective: +",
                other,
                "must be another objective: a constant changes no gradient",
            )),
        }
    }

    fn __sub__(&self, other: PyRef<'_, Self>) -> Self {
        Self(self.0.clone() - other.0.clone())
    }

    fn __neg__(&self) -> Self {
        Self(-self.0.clone())
    }

    fn __truediv__(&self, divisor: f64) -> PyResult<Self> {
        match divisor {
            0.0 => Err(input("objective: /", divisor, "must not be zero")),
            divisor => Ok(Self(self.0.clone().scaled(1.0 / divisor))),
        }
    }

    fn __mul__(&self, factor: f64) -> Self {
        Self(self.0.clone().scaled(factor))
    }

    fn __rmul__(&self, factor: f64) -> Self {
        self.__mul__(factor)
    }

    fn __repr__(&self) -> String {
        format!("Objective({:?})", self.0)
    }
}

/// Squared distance (m²) of the origin of `body`, its number or its name, from `target` (m, world axes) at the end.
#[pyfunction]
fn final_position(body: &Bound<'_, PyAny>, target: &Bound<'_, PyAny>) -> PyResult<Objective> {
    let target = fixed("final_position: target", target)?;
    Ok(Objective(objective::final_position(
        which("final_position", body)?,
        target,
    )))
}

/// Mean squared distance (m²) of the origin of `body`, its number or its name, from `target` (m, world axes) over all states.
#[pyfunction]
fn mean_position(body: &Bound<'_, PyAny>, target: &Bound<'_, PyAny>) -> PyResult<Objective> {
    let target = fixed("mean_position: target", target)?;
    Ok(Objective(objective::mean_position(
        which("mean_position", body)?,
        target,
    )))
}

/// `weight · (q[index] − target)²` at the end, for a coordinate of a prismatic, revolute or planar joint (m or rad).
#[pyfunction]
#[pyo3(signature = (index, target, weight=1.0))]
fn final_coordinate(
    #[pyo3(from_py_with = counts::index)] index: usize,
    target: f64,
    weight: f64,
) -> Objective {
    Objective(objective::final_coordinate(index, target, weight))
}

/// `weight · (v[index] − target)²` at the end (m/s or rad/s).
#[pyfunction]
#[pyo3(signature = (index, target, weight=1.0))]
fn final_velocity(
    #[pyo3(from_py_with = counts::index)] index: usize,
    target: f64,
    weight: f64,
) -> Objective {
    Objective(objective::final_velocity(index, target, weight))
}

/// `weight · (x − target)²` at the end, x entry number `entry` (last index fastest) of the observable `name` as `Rollout.observe` gives
/// it; the observable must have a transpose.
#[pyfunction]
#[pyo3(signature = (name, entry, target, weight=1.0))]
fn final_observable(
    name: &str,
    #[pyo3(from_py_with = counts::entry)] entry: usize,
    target: f64,
    weight: f64,
) -> Objective {
    Objective(objective::final_observable(name, entry, target, weight))
}

/// The mean of `weight · (x − target)²` over all states, x as in `final_observable`.
#[pyfunction]
#[pyo3(signature = (name, entry, target, weight=1.0))]
fn mean_observable(
    name: &str,
    #[pyo3(from_py_with = counts::entry)] entry: usize,
    target: f64,
    weight: f64,
) -> Objective {
    Objective(objective::mean_observable(name, entry, target, weight))
}

/// `weight` times the squared distance of the water's velocity from `target` (m/s, world axes) at the end, at a sensor at `point` (m), fixed in the world, or in the frame of `body`
/// (its number or its name): as `Rollout.sensor_flow` reads it.
#[pyfunction]
#[pyo3(signature = (point, target, weight=1.0, *, body=None))]
fn final_flow(
    point: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    weight: f64,
    body: Option<&Bound<'_, PyAny>>,
) -> PyResult<Objective> {
    let target = fixed("final_flow: target", target)?;
    let sensor = sensor("final_flow", point, body)?;
    Ok(Objective(objective::final_flow(sensor, target, weight)))
}

/// The mean of `final_flow` over all states.
#[pyfunction]
#[pyo3(signature = (point, target, weight=1.0, *, body=None))]
fn mean_flow(
    point: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    weight: f64,
    body: Option<&Bound<'_, PyAny>>,
) -> PyResult<Objective> {
    let target = fixed("mean_flow: target", target)?;
    let sensor = sensor("mean_flow", point, body)?;
    Ok(Objective(objective::mean_flow(sensor, target, weight)))
}

/// `weight · (p − target)²` at the end, p the flow's pressure (Pa) at a sensor as of `final_flow`: as `Rollout.sensor_pressure` reads it.
#[pyfunction]
#[pyo3(signature = (point, target, weight=1.0, *, body=None))]
fn final_pressure(
    point: &Bound<'_, PyAny>,
    target: f64,
    weight: f64,
    body: Option<&Bound<'_, PyAny>>,
) -> PyResult<Objective> {
    let sensor = sensor("final_pressure", point, body)?;
    Ok(Objective(objective::final_pressure(sensor, target, weight)))
}

/// The mean of `final_pressure` over all states.
#[pyfunction]
#[pyo3(signature = (point, target, weight=1.0, *, body=None))]
fn mean_pressure(
    point: &Bound<'_, PyAny>,
    target: f64,
    weight: f64,
    body: Option<&Bound<'_, PyAny>>,
) -> PyResult<Objective> {
    let sensor = sensor("mean_pressure", point, body)?;
    Ok(Objective(objective::mean_pressure(sensor, target, weight)))
}

/// `weight` times the sum of the squared open-loop controls (N², N² m²).
#[pyfunction]
fn effort(weight: f64) -> Objective {
    Objective(objective::effort(weight))
}

/// `weight` times the sum of the squares of the controls that acted, the open-loop ones and what the controller added (N², N² m²): its gains have a share in it.
#[pyfunction]
fn applied_effort(weight: f64) -> Objective {
    Objective(objective::applied_effort(weight))
}

/// Adds the functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(final_position, m)?)?;
    m.add_function(wrap_pyfunction!(mean_position, m)?)?;
    m.add_function(wrap_pyfunction!(final_coordinate, m)?)?;
    m.add_function(wrap_pyfunction!(final_velocity, m)?)?;
    m.add_function(wrap_pyfunction!(final_observable, m)?)?;
    m.add_function(wrap_pyfunction!(mean_observable, m)?)?;
    m.add_function(wrap_pyfunction!(final_flow, m)?)?;
    m.add_function(wrap_pyfunction!(mean_flow, m)?)?;
    m.add_function(wrap_pyfunction!(final_pressure, m)?)?;
    m.add_function(wrap_pyfunction!(mean_pressure, m)?)?;
    m.add_function(wrap_pyfunction!(effort, m)?)?;
    m.add_function(wrap_pyfunction!(applied_effort, m)?)
}
