//! The flow around the bodies of a rollout: at points, at sensors, and along lines.

use crate::array::{self, Array, Dim};
use crate::error::input;
use crate::interrupt::{Interrupt, long};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::objective::Which;
use hydrograd::simulate::{Cotangents, LineEnd, Sensor, StreamlineSettings, Way};
use nalgebra::DMatrix;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;
use std::sync::Arc;

type Numbers<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;
type Marks<'py> = Bound<'py, PyArray1<bool>>;
type Shared = Arc<hydrograd::Rollout>;

/// Bodies of sensors: one for all, or one each; None of what is fixed in the world.
pub type Bodies<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

fn vectors<'py>(py: Python<'py>, rows: &[Vec3]) -> Numbers<'py> {
    let values = rows.iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    array::to_python(py, values, &[rows.len(), 3])
}

/// A body, by its number from 0 or by its name.
pub fn which(place: &str, body: &Bound<'_, PyAny>) -> PyResult<Which> {
    if let Ok(name) = body.extract::<String>() {
        return Ok(Which::Named(name));
    }
    let number = body.extract::<usize>().map_err(|_| {
        let expected = "must be a body's number, from 0, or its name";
        input(format!("{place}: body"), body, expected)
    })?;
    Ok(Which::Number(number))
}

/// Sensors at points, m, in the world's frame or in those of `bodies`.
fn sensors(
    place: &str,
    points: &Bound<'_, PyAny>,
    bodies: Bodies<'_, '_>,
) -> PyResult<Vec<Sensor>> {
    let points = array::vectors(&format!("{place}: points"), points)?;
    let on = |body: &Bound<'_, PyAny>| match body.is_none() {
        true => Ok(None),
        false => which(place, body).map(Some),
    };
    let bodies: Vec<Option<Which>> = match bodies {
        None => vec![None; points.len()],
        Some(one) => match on(one) {
            Ok(one) => vec![one; points.len()],
            Err(refused) => match one.try_iter() {
                Ok(each) => each.map(|body| on(&body?)).collect::<PyResult<_>>()?,
                Err(_) => return Err(refused),
            },
        },
    };
    if bodies.len() != points.len() {
        return Err(input(
            format!("{place}: bodies"),
            bodies.len(),
            format!(
                "must be one body, or one for each of {} points",
                points.len()
            ),
        ));
    }
    let pairs = points.into_iter().zip(bodies);
    Ok(pairs
        .map(|(at, body)| Sensor {
            body,
            at: at.into(),
        })
        .collect())
}

/// One sensor for an objective.
pub fn sensor(place: &str, point: &Bound<'_, PyAny>, body: Bodies<'_, '_>) -> PyResult<Sensor> {
    Ok(Sensor {
        at: array::fixed(&format!("{place}: point"), point)?,
        body: body.map(|body| which(place, body)).transpose()?,
    })
}

/// Ends what the user stops.
fn go_on(interrupt: &Interrupt) -> hydrograd::Result<()> {
    match interrupt.check() {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(hydrograd::Error::Stopped {
            what: "the reading of sensors".into(),
        }),
    }
}

/// The state and the points that `what` is asked for.
fn asked(
    what: &str,
    rollout: &Shared,
    state: isize,
    points: &Bound<'_, PyAny>,
) -> PyResult<(usize, Vec<Vec3>)> {
    Ok((
        array::numbered(state, rollout.states().len(), "state")?,
        array::vectors(&format!("{what}: points"), points)?,
    ))
}

/// Velocities at points at a state.
pub fn flow<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    points: &Bound<'py, PyAny>,
) -> Numbers<'py> {
    let (at, points) = asked("flow", rollout, state, points)?;
    let inner = rollout.clone();
    let made = long(py, move |_| inner.flow(at, &points))?;
    vectors(py, &made)
}

/// Pressures at points at a state.
pub fn flow_pressure<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    points: &Bound<'py, PyAny>,
) -> Numbers<'py> {
    let (at, points) = asked("flow_pressure", rollout, state, points)?;
    let (inner, count) = (rollout.clone(), points.len());
    let made = long(py, move |_| inner.flow_pressure(at, &points))?;
    array::to_python(py, made, &[count])
}

/// Whether the flow is known at points at a state.
pub fn flow_resolved<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    points: &Bound<'py, PyAny>,
) -> PyResult<Marks<'py>> {
    let (at, points) = asked("flow_resolved", rollout, state, points)?;
    let inner = rollout.clone();
    let made = long(py, move |_| inner.flow_resolved(at, &points))?;
    Ok(PyArray1::from_vec(py, made))
}

/// Velocities at points at a state, zero where they aren't known, and whether they are.
pub fn known_flow<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    points: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Marks<'py>)> {
    let (at, points) = asked("known_flow", rollout, state, points)?;
    let inner = rollout.clone();
    let made = long(py, move |_| inner.known_flow(at, &points))?;
    let known = made.iter().map(Option::is_some).collect();
    let velocities: Vec<Vec3> = made.iter().map(|u| u.unwrap_or_default()).collect();
    Ok((vectors(py, &velocities)?, PyArray1::from_vec(py, known)))
}

/// The potential at points at a state.
pub fn potential<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    points: &Bound<'py, PyAny>,
) -> Numbers<'py> {
    let (at, points) = asked("potential", rollout, state, points)?;
    let (inner, count) = (rollout.clone(), points.len());
    let made = long(py, move |_| inner.potential(at, &points))?;
    array::to_python(py, made, &[count])
}

/// Velocities at sensors at all states.
pub fn sensor_flow<'py>(
    py: Python<'py>,
    rollout: &Shared,
    points: &Bound<'py, PyAny>,
    bodies: Bodies<'_, 'py>,
) -> Numbers<'py> {
    let sensors = sensors("sensor_flow", points, bodies)?;
    let (inner, states) = (rollout.clone(), rollout.states().len());
    let shape = [states, sensors.len(), 3];
    let made = long(py, move |interrupt| {
        let read = (0..states).map(|n| {
            go_on(interrupt)?;
            inner.sensor_flow(n, &sensors)
        });
        read.collect::<hydrograd::Result<Vec<_>>>()
    })?;
    let values = made.iter().flatten().flat_map(|u| [u.x, u.y, u.z]);
    array::to_python(py, values.collect(), &shape)
}

/// Pressures at sensors at all states.
pub fn sensor_pressure<'py>(
    py: Python<'py>,
    rollout: &Shared,
    points: &Bound<'py, PyAny>,
    bodies: Bodies<'_, 'py>,
) -> Numbers<'py> {
    let sensors = sensors("sensor_pressure", points, bodies)?;
    let (inner, states) = (rollout.clone(), rollout.states().len());
    let shape = [states, sensors.len()];
    let made = long(py, move |interrupt| {
        let read = (0..states).map(|n| {
            go_on(interrupt)?;
            inner.sensor_pressure(n, &sensors)
        });
        read.collect::<hydrograd::Result<Vec<_>>>()
    })?;
    array::to_python(py, made.concat(), &shape)
}

/// What the cotangents of readings are of: keywords of `Rollout.vjp`.
pub fn sensor_vjp<'py>(
    py: Python<'py>,
    rollout: &Shared,
    points: &Bound<'py, PyAny>,
    bodies: Bodies<'_, 'py>,
    flow: Option<&Bound<'py, PyAny>>,
    pressure: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let sensors = sensors("sensor_vjp", points, bodies)?;
    let (states, count) = (Dim::Is(rollout.states().len()), sensors.len());
    let bars = |name: &str, given: Option<&Bound<'_, PyAny>>, each: usize| {
        let columns = |given| {
            let place = format!("sensor_vjp: {name}");
            let shape = match each {
                1 => vec![states, Dim::Is(count)],
                each => vec![states, Dim::Is(count), Dim::Is(each)],
            };
            let found: Array = array::array(&place, given, &shape)?;
            Ok::<DMatrix<f64>, PyErr>(found.columns(each * count))
        };
        given.map(columns).transpose()
    };
    let (flow, pressure) = (bars("flow", flow, 3)?, bars("pressure", pressure, 1)?);
    let inner = rollout.clone();
    let made: Cotangents = long(py, move |_| {
        inner.sensor_vjp(&sensors, flow.as_ref(), pressure.as_ref())
    })?;
    let bodies = rollout.simulator().system().len();
    let out = PyDict::new(py);
    let parts = [
        ("positions", &made.positions),
        ("rotations", &made.rotations),
    ];
    for (name, x) in parts {
        out.set_item(name, array::transposed(py, x, &[bodies, 3])?)?;
    }
    let observables = PyDict::new(py);
    for (name, x) in &made.observables {
        observables.set_item(name, array::transposed(py, x, &[bodies, 6])?)?;
    }
    out.set_item("observables", observables)?;
    out.set_item("density", made.density)?;
    Ok(out)
}

/// Why a line ends.
fn end(end: &LineEnd) -> String {
    match end {
        LineEnd::Length => "length".into(),
        LineEnd::Box => "box".into(),
        LineEnd::Body(name) => format!("body {name:?}"),
        LineEnd::Wall(wall) => format!("wall {wall}"),
        LineEnd::Still => "still".into(),
        LineEnd::Steps => "steps".into(),
    }
}

/// Streamlines: their settings as Python gives them.
pub struct Drawn<'py> {
    pub length: f64,
    pub tolerance: Option<f64>,
    pub most_steps: usize,
    pub within: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    pub way: String,
}

/// Streamlines at a state, a dictionary each.
pub fn streamlines<'py>(
    py: Python<'py>,
    rollout: &Shared,
    state: isize,
    seeds: &Bound<'py, PyAny>,
    drawn: Drawn<'py>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let at = array::numbered(state, rollout.states().len(), "state")?;
    let seeds = array::vectors("streamlines: seeds", seeds)?;
    let way = match drawn.way.as_str() {
        "both" => Way::Both,
        "forward" => Way::Forward,
        "backward" => Way::Backward,
        other => {
            let expected = "must be \"both\", \"forward\" or \"backward\"";
            return Err(input("streamlines: way", format!("{other:?}"), expected));
        }
    };
    let corners = |(low, high): (Bound<'py, PyAny>, Bound<'py, PyAny>)| {
        Ok::<_, PyErr>([
            array::fixed("streamlines: within: low", &low)?,
            array::fixed("streamlines: within: high", &high)?,
        ])
    };
    let settings = StreamlineSettings {
        length: drawn.length,
        tolerance: drawn.tolerance,
        most_steps: drawn.most_steps,
        within: drawn.within.map(corners).transpose()?,
        way,
    };
    let inner = rollout.clone();
    let made = long(py, move |_| inner.streamlines(at, &seeds, &settings))?;
    let of = |line: &hydrograd::simulate::Streamline| {
        let out = PyDict::new(py);
        out.set_item("points", vectors(py, &line.points)?)?;
        out.set_item("velocities", vectors(py, &line.velocities)?)?;
        out.set_item("seed", line.seed)?;
        out.set_item("ends", line.ends.each_ref().map(|e| e.as_ref().map(end)))?;
        Ok(out)
    };
    made.iter().map(of).collect()
}

/// Path lines, a dictionary each.
pub fn path_lines<'py>(
    py: Python<'py>,
    rollout: &Shared,
    seeds: &Bound<'py, PyAny>,
    (from, to): (isize, isize),
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let states = rollout.states().len();
    let [from, to] = [from, to].map(|n| array::numbered(n, states, "state"));
    let (from, to) = (from?, to?);
    let seeds = array::vectors("path_lines: seeds", seeds)?;
    let inner = rollout.clone();
    let made = long(py, move |_| inner.path_lines(&seeds, from, to))?;
    let of = |line: &hydrograd::simulate::PathLine| {
        let out = PyDict::new(py);
        out.set_item("points", vectors(py, &line.points)?)?;
        out.set_item("velocities", vectors(py, &line.velocities)?)?;
        let count = line.times.len();
        out.set_item("times", array::to_python(py, line.times.clone(), &[count])?)?;
        out.set_item("end", end(&line.end))?;
        Ok(out)
    };
    made.iter().map(of).collect()
}
