//! Forward mode for Python: directions from arrays, tangents and Jacobians to arrays.

use crate::array::{self, Array, Dim};
use crate::error::{OrRaise, input};
use crate::interrupt::{long, short};
use crate::mapping;
use hydrograd::simulate::{Displacement, Jacobians, Record, Tangents, Variables, observable};
use nalgebra::{DMatrix, DVector};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// What a tangent is asked along, as it was given: each with or without a first index for the directions.
pub struct Along<'a, 'py> {
    pub controls: Option<&'a Bound<'py, PyAny>>,
    pub q: Option<&'a Bound<'py, PyAny>>,
    pub v: Option<&'a Bound<'py, PyAny>>,
    pub parameters: Option<&'a Bound<'py, PyAny>>,
    pub gains: Option<&'a Bound<'py, PyAny>>,
}

/// One part of all directions.
struct Part {
    values: Vec<f64>,
    /// Numbers of one direction.
    size: usize,
    /// None where all directions share one.
    count: Option<usize>,
}

impl Part {
    fn new(place: &str, given: &Bound<'_, PyAny>, inner: &[Dim]) -> PyResult<Self> {
        let size = |shape: &[usize]| shape.iter().product();
        let rank: usize = given
            .py()
            .import("numpy")?
            .call_method1("ndim", (given,))?
            .extract()?;
        if rank <= inner.len() {
            let Array { values, shape } = array::array(place, given, inner)?;
            return Ok(Self {
                values,
                size: size(&shape),
                count: None,
            });
        }
        let mut whole = vec![Dim::Any("directions")];
        whole.extend(inner);
        let Array { values, shape } = array::array(place, given, &whole)?;
        Ok(Self {
            values,
            size: size(&shape[1..]),
            count: Some(shape[0]),
        })
    }

    fn of(&self, direction: usize) -> &[f64] {
        let from = self.count.map_or(0, |_| direction * self.size);
        &self.values[from..from + self.size]
    }
}

/// The number of directions that all parts share; none where no part has an index for them.
fn shared<'p>(parts: impl Iterator<Item = (&'p String, &'p Part)>) -> PyResult<Option<usize>> {
    let mut found: Option<(&String, usize)> = None;
    for (place, part) in parts {
        let Some(count) = part.count else { continue };
        match found {
            Some((first, right)) if right != count => {
                return Err(input(
                    place,
                    format!("{count} directions"),
                    format!("must be {right}, as in {first}"),
                ));
            }
            _ => found = Some((place, count)),
        }
    }
    Ok(found.map(|(_, count)| count))
}

/// Displacements from what was given, and whether they have an index of their own; controls are named `control`, and have these dimensions.
fn displacements(
    rollout: &hydrograd::Rollout,
    along: &Along,
    control: &str,
    dimensions: Vec<Dim>,
) -> PyResult<(Vec<Displacement>, bool)> {
    let zero = rollout.zero_displacement();
    let (nu, nv) = (zero.controls.nrows(), zero.initial.q.len());
    let mut parts: Vec<(String, Part)> = Vec::new();
    let inner = [
        (along.controls, control, dimensions),
        (along.q, "q", vec![Dim::Is(nv)]),
        (along.v, "v", vec![Dim::Is(nv)]),
        (along.gains, "gains", vec![Dim::Is(zero.gains.len())]),
    ];
    for (given, name, inner) in inner {
        if let Some(given) = given {
            let place = format!("jvp: {name}");
            let part = Part::new(&place, given, &inner)?;
            parts.push((place, part));
        }
    }
    let mut named: Vec<(String, Part)> = Vec::new();
    let parameters = mapping::named("jvp: parameters", "an array", along.parameters)?;
    for (name, given) in parameters {
        let given: Bound<'_, PyAny> = given;
        zero.parameters.place(&name).or_raise()?;
        let part = Part::new(&format!("jvp: parameters[{name:?}]"), &given, &[])?;
        named.push((name, part));
    }
    let all = parts
        .iter()
        .chain(&named)
        .map(|(place, part)| (place, part));
    let count = shared(all)?;
    let made = (0..count.unwrap_or(1)).map(|k| {
        let mut out = zero.clone();
        for (place, part) in &parts {
            let x = part.of(k);
            match place.as_str() {
                "jvp: controls" | "jvp: u" => {
                    out.controls = DMatrix::from_column_slice(nu, rollout.steps(), x)
                }
                "jvp: q" => out.initial.q = DVector::from_column_slice(x),
                "jvp: v" => out.initial.v = DVector::from_column_slice(x),
                _ => out.gains = x.to_vec(),
            }
        }
        for (name, part) in &named {
            out.parameters.set(name, part.of(k)[0]).or_raise()?;
        }
        Ok(out)
    });
    Ok((made.collect::<PyResult<_>>()?, count.is_some()))
}

/// Shape of an observable's tangent, and of its cotangent, at one state.
pub fn tangent_shape(rollout: &hydrograd::Rollout, name: &str) -> PyResult<Vec<usize>> {
    let system = rollout.simulator().system();
    let rows = observable::differentiable(name)
        .or_raise()?
        .tangents(system);
    // They turn by δθ.
    if ["rotations", "site_rotations"].contains(&name) {
        return Ok(vec![rows / 3, 3]);
    }
    let shape = observable::observable(name).or_raise()?.shape(system);
    Ok(match shape.iter().product::<usize>() == rows {
        true => shape,
        false => vec![rows],
    })
}

/// [`hydrograd::Rollout::jvp`] as an instance of `hydrograd._gradient.Tangents`.
pub fn jvp<'py>(
    py: Python<'py>,
    rollout: &Arc<hydrograd::Rollout>,
    along: &Along<'_, 'py>,
    observables: Vec<String>,
) -> PyResult<Bound<'py, PyAny>> {
    let dimensions = vec![
        Dim::Is(rollout.steps()),
        Dim::Is(rollout.controls().nrows()),
    ];
    let (displacements, many) = displacements(rollout, along, "controls", dimensions)?;
    let count = displacements.len();
    let mut names: Vec<String> = vec!["positions".into(), "rotations".into()];
    names.extend(
        observables
            .iter()
            .filter(|o| !["positions", "rotations"].contains(&o.as_str()))
            .cloned(),
    );
    for name in &names {
        tangent_shape(rollout, name)?;
    }
    let (shared, asked) = (rollout.clone(), names.clone());
    let made: Vec<Tangents> = long(py, move |interrupt| {
        let asked: Vec<&str> = asked.iter().map(String::as_str).collect();
        shared.jvp_with(&displacements, &asked, |_| interrupt.check())
    })?;
    let (steps, states) = (rollout.steps(), rollout.states().len());
    let stacked = |of: &dyn Fn(&Tangents) -> &DMatrix<f64>, rows: usize, inner: &[usize]| {
        let values = made.iter().flat_map(|t| of(t).iter().copied()).collect();
        let lead = if many { vec![count] } else { Vec::new() };
        array::to_python(py, values, &[&lead, &[rows][..], inner].concat())
    };
    let nv = [rollout.simulator().system().tree.velocities()];
    let nu = [rollout.controls().nrows()];
    let observed = |name: &str| {
        let inner = tangent_shape(rollout, name)?;
        stacked(&|t| &t.observables[name], states, &inner)
    };
    let others = PyDict::new(py);
    for name in &observables {
        others.set_item(name, observed(name)?)?;
    }
    let parts = (
        stacked(&|t| &t.q, states, &nv)?,
        stacked(&|t| &t.v, states, &nv)?,
        observed("positions")?,
        observed("rotations")?,
        stacked(&|t| &t.applied_controls, steps, &nu)?,
        others,
    );
    py.import("hydrograd._gradient")?
        .getattr("Tangents")?
        .call1(parts)
}

/// The same of a step: q and v after it.
pub fn of_step<'py>(
    py: Python<'py>,
    record: &Record,
    along: &Along<'_, 'py>,
) -> PyResult<Bound<'py, PyTuple>> {
    let rollout = record.rollout();
    let dimensions = vec![Dim::Is(rollout.controls().nrows())];
    let (displacements, many) = displacements(rollout, along, "u", dimensions)?;
    let made = short(py, || rollout.jvp(&displacements, &[]))?;
    let nv = rollout.simulator().system().tree.velocities();
    let after = |of: fn(&Tangents) -> &DMatrix<f64>| {
        let values = made
            .iter()
            .flat_map(|t| of(t).column(1).into_owned().as_slice().to_vec());
        let lead = if many { vec![made.len()] } else { Vec::new() };
        array::to_python(
            py,
            values.collect::<Vec<f64>>(),
            &[&lead[..], &[nv]].concat(),
        )
    };
    PyTuple::new(py, [after(|t| &t.q)?, after(|t| &t.v)?])
}

/// [`hydrograd::Rollout::jacobian`] by the names of the observables.
pub fn jacobian<'py>(
    py: Python<'py>,
    rollout: &Arc<hydrograd::Rollout>,
    variables: Variables,
    observables: Vec<String>,
    states: Option<Vec<isize>>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = rollout.states().len();
    let states: Vec<usize> = match states {
        None => (0..all).collect(),
        Some(given) => {
            let each = given.iter().map(|n| array::numbered(*n, all, "state"));
            each.collect::<PyResult<_>>()?
        }
    };
    let shapes = observables.iter().map(|name| tangent_shape(rollout, name));
    let shapes = shapes.collect::<PyResult<Vec<_>>>()?;
    let (shared, asked, count) = (rollout.clone(), observables.clone(), states.len());
    let made = long(py, move |interrupt| {
        let asked: Vec<&str> = asked.iter().map(String::as_str).collect();
        shared.jacobian_with(&variables, &asked, &states, |_| interrupt.check())
    })?;
    let out = PyDict::new(py);
    for ((name, matrix), shape) in observables.iter().zip(&made).zip(shapes) {
        let whole = [&[count][..], &shape, &[matrix.ncols()]].concat();
        let values = matrix.transpose().as_slice().to_vec();
        out.set_item(name, array::to_python(py, values, &whole)?)?;
    }
    Ok(out)
}

/// Matrices as a tuple of arrays: A and B, and where parameters were asked for their columns; with an index for the steps before, if `many`.
pub fn matrices<'py>(
    py: Python<'py>,
    made: &[Jacobians],
    with_parameters: bool,
    many: bool,
    shapes: [[usize; 2]; 3],
) -> PyResult<Bound<'py, PyTuple>> {
    type Of = fn(&Jacobians) -> &DMatrix<f64>;
    let parts: [Of; 3] = [|j| &j.state, |j| &j.controls, |j| &j.parameters];
    let count = if with_parameters { 3 } else { 2 };
    let arrays = parts
        .into_iter()
        .zip(shapes)
        .take(count)
        .map(|(of, shape)| {
            let values = made
                .iter()
                .flat_map(|j| of(j).transpose().as_slice().to_vec());
            let lead = if many { vec![made.len()] } else { Vec::new() };
            array::to_python(py, values.collect(), &[&lead[..], &shape].concat())
        });
    let arrays: Vec<Bound<'py, PyArrayDyn<f64>>> = arrays.collect::<PyResult<_>>()?;
    PyTuple::new(py, arrays)
}

/// Shapes of A, B and the parameters' columns of one step.
pub fn shapes(rollout: &hydrograd::Rollout, parameters: usize) -> [[usize; 2]; 3] {
    let system = rollout.simulator().system();
    let rows = 2 * system.tree.velocities();
    [[rows, rows], [rows, system.controls], [rows, parameters]]
}

/// [`hydrograd::Rollout::step_jacobians`] as arrays.
pub fn step_jacobians<'py>(
    py: Python<'py>,
    rollout: &Arc<hydrograd::Rollout>,
    parameters: Option<Vec<String>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let (shared, names) = (rollout.clone(), parameters.clone().unwrap_or_default());
    let shapes = shapes(rollout, names.len());
    let made = long(py, move |_| {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        shared.step_jacobians(&names)
    })?;
    matrices(py, &made, parameters.is_some(), true, shapes)
}
