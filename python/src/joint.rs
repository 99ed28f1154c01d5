//! Joints, and given motions of their coordinates.

use crate::array::{self, fixed};
use crate::error::{exception, input};
use hydrograd::scene::{self, Plane};
use pyo3::prelude::*;

/// How a body moves against its parent: made by `free`, `fixed`, `prismatic`, `revolute`, `screw`, `planar` or `spherical`.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Joint(pub hydrograd::Joint);

#[pymethods]
impl Joint {
    /// The joint's name in a scene file.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind()
    }

    /// Number of coordinates q.
    #[getter]
    fn q_size(&self) -> usize {
        self.0.coordinates()
    }

    /// Number of generalised velocities v.
    #[getter]
    fn v_size(&self) -> usize {
        self.0.velocities()
    }

    fn __repr__(&self) -> String {
        let fields = match serde_json::to_value(self.0) {
            Ok(serde_json::Value::Object(fields)) => fields,
            _ => Default::default(),
        };
        let given = fields.iter().filter(|(key, _)| *key != "kind");
        let given: Vec<String> = given.map(|(_, value)| shown(value)).collect();
        format!("{}({})", self.0.kind(), given.join(", "))
    }
}

/// A value of a joint as Python writes it.
fn shown(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Array(items) => {
            let items: Vec<String> = items.iter().map(shown).collect();
            format!("({})", items.join(", "))
        }
        other => other.to_string(),
    }
}

/// A given motion of one joint coordinate, q(t): made by `Motion.linear`, `Motion.sine` or `Motion.spline`.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Motion(pub scene::Motion);

impl Motion {
    /// As a scene file gives it.
    pub fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.0).map_err(|e| input("motion", e, "must be one"))?;
        py.import("json")?.call_method1("loads", (text,))
    }
}

#[pymethods]
impl Motion {
    /// `offset + rate·t`: offset in m or rad, rate in m/s or rad/s.
    #[staticmethod]
    #[pyo3(signature = (rate, offset=0.0))]
    fn linear(rate: f64, offset: f64) -> Self {
        Self(scene::Motion::Linear { offset, rate })
    }

    /// `offset + amplitude·sin(frequency·t + phase)`: amplitude and offset in m or rad, frequency in rad/s, phase in rad.
    #[staticmethod]
    #[pyo3(signature = (amplitude, frequency, phase=0.0, offset=0.0))]
    fn sine(amplitude: f64, frequency: f64, phase: f64, offset: f64) -> Self {
        Self(scene::Motion::Sine {
            offset,
            amplitude,
            frequency,
            phase,
        })
    }

    /// Through `values` (m or rad) at `times` (s, ascending), by the natural cubic spline: C², straight before the first and after the last. Give points as far apart as the motion is
    /// smooth: a recording's noise would be the joint's acceleration.
    #[staticmethod]
    fn spline(times: &Bound<'_, PyAny>, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let times = array::row("Motion.spline: times", times)?;
        let values = array::row("Motion.spline: values", values)?;
        Ok(Self(
            scene::Motion::through(times, values).map_err(exception)?,
        ))
    }

    fn __repr__(&self) -> String {
        match &self.0 {
            scene::Motion::Spline(spline) => {
                let (times, values) = (spline.times(), spline.values());
                let n = times.len() - 1;
                format!(
                    "Motion.spline({} points from {:?} at t = {:?} to {:?} at t = {:?})",
                    n + 1,
                    values[0],
                    times[0],
                    values[n],
                    times[n]
                )
            }
            scene::Motion::Linear { offset, rate } => {
                format!("Motion.linear(rate={rate:?}, offset={offset:?})")
            }
            scene::Motion::Sine {
                offset,
                amplitude,
                frequency,
                phase,
            } => format!(
                "Motion.sine(amplitude={amplitude:?}, frequency={frequency:?}, phase={phase:?}, offset={offset:?})"
            ),
        }
    }
}

/// A joint that lets a body move freely: q = position (m) and unit quaternion (w, x, y, z), v = velocity of the body's
/// origin (m/s) and angular velocity (rad/s), in the parent's frame.
#[pyfunction]
fn free() -> Joint {
    Joint(hydrograd::Joint::Free)
}

/// A joint that doesn't move.
#[pyfunction(name = "fixed")]
fn rigid() -> Joint {
    Joint(hydrograd::Joint::Fixed)
}

/// A joint along `axis` (three numbers, joint's frame): q in m, v in m/s.
#[pyfunction]
fn prismatic(axis: &Bound<'_, PyAny>) -> PyResult<Joint> {
    Ok(Joint(hydrograd::Joint::Prismatic {
        axis: fixed("prismatic: axis", axis)?,
    }))
}

/// A joint about `axis` (three numbers, joint's frame): q in rad, v in rad/s.
#[pyfunction]
fn revolute(axis: &Bound<'_, PyAny>) -> PyResult<Joint> {
    Ok(Joint(hydrograd::Joint::Revolute {
        axis: fixed("revolute: axis", axis)?,
    }))
}

/// A joint about `axis` (three numbers, joint's frame) that advances along it by `pitch` (m) in one revolution; a negative
/// pitch is a left-handed thread. q in rad, v in rad/s.
#[pyfunction]
fn screw(axis: &Bound<'_, PyAny>, pitch: f64) -> PyResult<Joint> {
    Ok(Joint(hydrograd::Joint::Screw {
        axis: fixed("screw: axis", axis)?,
        pitch,
    }))
}

/// A joint in a plane, "xy", "yz" or "zx": q = two translations in that order (m) and the angle about the normal (rad).
#[pyfunction]
fn planar(plane: &str) -> PyResult<Joint> {
    let plane = match plane {
        "xy" => Plane::Xy,
        "yz" => Plane::Yz,
        "zx" => Plane::Zx,
        _ => {
            return Err(input(
                "planar: plane",
                format!("{plane:?}"),
                "must be \"xy\", \"yz\" or \"zx\"",
            ));
        }
    };
    Ok(Joint(hydrograd::Joint::Planar { plane }))
}

/// A joint about a point: q a unit quaternion (w, x, y, z), v the angular velocity in the parent's frame, rad/s.
#[pyfunction]
fn spherical() -> Joint {
    Joint(hydrograd::Joint::Spherical)
}

/// Adds the functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(free, m)?)?;
    m.add_function(wrap_pyfunction!(rigid, m)?)?;
    m.add_function(wrap_pyfunction!(prismatic, m)?)?;
    m.add_function(wrap_pyfunction!(revolute, m)?)?;
    m.add_function(wrap_pyfunction!(screw, m)?)?;
    m.add_function(wrap_pyfunction!(planar, m)?)?;
    m.add_function(wrap_pyfunction!(spherical, m)?)
}
