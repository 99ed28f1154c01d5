//! Terms of the cost of optimal control.

use crate::array::{self, Dim, array};
use crate::error::{counts, input};
use crate::nested::ask;
use hydrograd::optimize::{CostPoint, CustomCost, Quadratic, Target, Term, Weights, terms};
use hydrograd::{Error, Result};
use nalgebra::{DMatrix, DVector};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// A term of the cost that `hydrograd.optimize.ilqr` lowers: made by its static methods, which are the functions of `hydrograd.cost`.
///
/// It is the sum of `weights` times squared entries: one weight for all, or one each. A running term is integrated over time: at every knot but the last it counts its value times
/// the knot's duration. With `last=True` it counts once, at the end. Targets stand, or move: with `times` (n,), s, of the simulation's clock, `target` has a row for each, and goes straight from row to row.
#[pyclass(frozen, module = "hydrograd.cost")]
#[derive(Clone)]
pub struct CostTerm {
    /// The term.
    pub term: Term,
    /// Whether it counts at the end.
    pub last: bool,
}

fn target(
    place: &str,
    given: &Bound<'_, PyAny>,
    times: Option<&Bound<'_, PyAny>>,
) -> PyResult<Target> {
    use crate::error::OrRaise;
    let place = format!("{place}: target");
    let Some(times) = times else {
        return Ok(match given.extract::<f64>() {
            Ok(one) => Target::from(one),
            Err(_) => Target::fixed(array::row(&place, given)?),
        });
    };
    let times = array::row("times", times)?;
    let found = array(&place, given, &[Dim::Is(times.len()), Dim::Any("n")])?;
    let n = found.shape[1].max(1);
    let rows = found.values.chunks(n).map(<[f64]>::to_vec).collect();
    Target::table(times, rows).or_raise()
}

fn weights(place: &str, given: &Bound<'_, PyAny>) -> PyResult<Weights> {
    Ok(match given.extract::<f64>() {
        Ok(all) => Weights::from(all),
        Err(_) => Weights::from(array::row(&format!("{place}: weights"), given)?),
    })
}

#[pymethods]
impl CostTerm {
    /// Distance of all coordinates from `target` (q_size,), in their tangent space: `weights` one or (v_size,).
    #[staticmethod]
    #[pyo3(signature = (target, weights, *, times=None, last=false))]
    fn configuration(
        target: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
        last: bool,
    ) -> PyResult<Self> {
        let goal = self::target("configuration", target, times)?;
        let term = terms::configuration(goal, self::weights("configuration", weights)?);
        Ok(Self { term, last })
    }

    /// Distance of the generalised velocity from `target` (v_size,), m/s, rad/s.
    #[staticmethod]
    #[pyo3(signature = (target, weights, *, times=None, last=false))]
    fn velocity(
        target: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
        last: bool,
    ) -> PyResult<Self> {
        let goal = self::target("velocity", target, times)?;
        let term = terms::velocity(goal, self::weights("velocity", weights)?);
        Ok(Self { term, last })
    }

    /// The open-loop controls, N and N m; or their distance from `target` (control_size,), where one is given.
    #[staticmethod]
    #[pyo3(signature = (weights, *, target=None, times=None))]
    fn effort(
        weights: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let weights = self::weights("effort", weights)?;
        let term = match (target, times) {
            (None, None) => terms::effort(weights),
            (None, Some(times)) => {
                let remedy = "give a `target` with a row for each, or leave them out";
                return Err(input("effort: times", times.repr()?, remedy));
            }
            (Some(target), times) => {
                terms::control(self::target("effort", target, times)?, weights)
            }
        };
        Ok(Self { term, last: false })
    }

    /// Changes of the open-loop controls from one knot to the next.
    #[staticmethod]
    fn control_change(weights: &Bound<'_, PyAny>) -> PyResult<Self> {
        let term = terms::control_change(self::weights("control_change", weights)?);
        Ok(Self { term, last: false })
    }

    /// Distance of a point of the body or site named `frame` from `target` (3,), m, world axes: that of its origin, or of `point` (3,), m, its frame.
    #[staticmethod]
    #[pyo3(signature = (frame, target, weights, *, point=None, times=None, last=false))]
    fn position(
        frame: String,
        target: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        point: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
        last: bool,
    ) -> PyResult<Self> {
        let at = array::or_zeros("position: point", point)?;
        let goal = self::target("position", target, times)?;
        let term = terms::point(frame, at, goal, self::weights("position", weights)?);
        Ok(Self { term, last })
    }

    /// Rotation vector, rad, world axes, that takes the axes of the body or site named `frame` from `target`, a rotation vector (3,) from the world's axes, to where they are.
    #[staticmethod]
    #[pyo3(signature = (frame, target, weights, *, times=None, last=false))]
    fn orientation(
        frame: String,
        target: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
        last: bool,
    ) -> PyResult<Self> {
        let goal = self::target("orientation", target, times)?;
        let term = terms::orientation(frame, goal, self::weights("orientation", weights)?);
        Ok(Self { term, last })
    }

    /// Distance of some `entries` (n,) (last index fastest) of the observable `name` from `target` (n,); the observable must have a transpose.
    #[staticmethod]
    #[pyo3(signature = (name, entries, target, weights, *, times=None, last=false))]
    fn observable(
        name: String,
        #[pyo3(from_py_with = counts::entries)] entries: Vec<usize>,
        target: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
        last: bool,
    ) -> PyResult<Self> {
        let goal = self::target("observable", target, times)?;
        let weights = self::weights("observable", weights)?;
        let term = terms::observable(name, entries, goal, weights);
        Ok(Self { term, last })
    }

    /// A cost of your own. `function(point)` is given a `hydrograd.cost.Point` and gives a tuple (cost, x, u) or (cost, x, u, xx, uu, ux): the cost (a running one per second), its gradient by the state,
    /// (2 v_size,) (coordinates in their tangent space, then velocity), by the controls, (control_size,), and their second derivatives, ux (control_size, 2 v_size). None is zero. It is
    /// called from several threads.
    #[staticmethod]
    #[pyo3(signature = (function, *, last=false))]
    fn custom(function: &Bound<'_, PyAny>, last: bool) -> PyResult<Self> {
        if !function.is_callable() {
            return Err(input(
                "cost: custom",
                format!("a value of type {}", function.get_type().name()?),
                "must be callable, and give a cost and its derivatives",
            ));
        }
        let term = terms::custom(Custom(function.clone().unbind()));
        Ok(Self { term, last })
    }
}

/// A cost written in Python.
struct Custom(Py<PyAny>);

impl Custom {
    fn call<'py>(&self, py: Python<'py>, at: &CostPoint) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let sample = at.sample();
        let vector = |x: &DVector<f64>| array::to_python(py, x.as_slice().to_vec(), &[x.len()]);
        let control = at.control.map(vector).transpose()?;
        let parts = (
            at.knot,
            sample.time,
            vector(&sample.q)?,
            vector(&sample.v)?,
            control,
        );
        let point = py
            .import("hydrograd._optimize")?
            .getattr("Point")?
            .call1(parts)?;
        let given = self.0.bind(py).call1((point,))?;
        match given.cast::<PyTuple>() {
            Ok(parts) if [3, 6].contains(&parts.len()) => Ok(parts.iter().collect()),
            _ => Err(input(
                "cost: custom",
                format!("a value of type {}", given.get_type().name()?),
                "must be a tuple (cost, x, u) or (cost, x, u, xx, uu, ux)",
            )),
        }
    }
}

/// What the Rust side makes of an exception.
fn raised(error: PyErr) -> Error {
    Error::Controller {
        source: Box::new(error),
    }
}

impl CustomCost for Custom {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        ask(|py| self.call(py, at)?[0].extract()).map_err(raised)
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let system = at.rollout.simulator().system();
        let (n, m) = (2 * system.tree.velocities(), system.controls);
        ask(|py| {
            let parts = self.call(py, at)?;
            let part = |k: usize, name: &str, shape: &[usize]| -> PyResult<Vec<f64>> {
                match parts.get(k).filter(|part| !part.is_none()) {
                    None => Ok(vec![0.0; shape.iter().product()]),
                    Some(part) => {
                        let dims: Vec<Dim> = shape.iter().map(|n| Dim::Is(*n)).collect();
                        Ok(array(&format!("cost: custom: {name}"), part, &dims)?.values)
                    }
                }
            };
            Ok(Quadratic {
                value: parts[0].extract()?,
                x: part(1, "x", &[n])?.into(),
                u: part(2, "u", &[m])?.into(),
                xx: DMatrix::from_row_slice(n, n, &part(3, "xx", &[n, n])?),
                uu: DMatrix::from_row_slice(m, m, &part(4, "uu", &[m, m])?),
                ux: DMatrix::from_row_slice(m, n, &part(5, "ux", &[m, n])?),
            })
        })
        .map_err(raised)
    }
}
