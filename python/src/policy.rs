//! Controllers written in Python. What one raises ends the run as the run's error, and comes out as the exception that it was.

use crate::array::{self, Dim};
use crate::error::{exception, input};
use crate::nested::ask;
use hydrograd::simulate::{Action, ActionBar, Observation, Policy};
use nalgebra::DVector;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType, PyWeakrefMethods, PyWeakrefReference};

/// A controller written in Python: an object with `act`, and, to be differentiated, `act_vjp`.
///
/// What holds the simulator in Python holds the object as well, where the garbage collector sees it: from here it is only pointed at, so that an
/// object which holds its simulator can be collected together with it.
pub struct Controller {
    object: Pointer,
    controls: usize,
    velocities: usize,
    gains: Vec<f64>,
}

enum Pointer {
    Weak(Py<PyWeakrefReference>),
    /// Of an object that can't be pointed at (one with `__slots__`, say).
    Strong(Py<PyAny>),
}

impl Controller {
    /// The object.
    fn object<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        match &self.object {
            Pointer::Weak(at) => {
                (at.bind(py).upgrade()).unwrap_or_else(|| py.None().into_bound(py))
            }
            Pointer::Strong(object) => object.bind(py).clone(),
        }
    }

    /// A controller of a system with so many controls and velocities.
    pub fn new(
        object: &Bound<'_, PyAny>,
        (controls, velocities): (usize, usize),
    ) -> PyResult<Self> {
        if let Ok(class) = object.cast::<PyType>() {
            let name = class.name()?;
            return Err(input(
                "with_policy: policy",
                format!("the class {name}"),
                format!("must be a controller: make one of it, {name}(…)"),
            ));
        }
        if !object.hasattr("act")? {
            return Err(input(
                "with_policy: policy",
                format!("a value of type {}", object.get_type().name()?),
                "must have a method act(observation)",
            ));
        }
        let gains = match object.getattr_opt("gains")? {
            Some(gains) if !gains.is_none() => array::row("policy: gains", &gains)?,
            _ => Vec::new(),
        };
        Ok(Self {
            object: match PyWeakrefReference::new(object) {
                Ok(at) => Pointer::Weak(at.unbind()),
                Err(_) => Pointer::Strong(object.clone().unbind()),
            },
            controls,
            velocities,
            gains,
        })
    }

    fn observation<'py>(py: Python<'py>, seen: &Observation) -> PyResult<Bound<'py, PyAny>> {
        let vector = |x: &DVector<f64>| array::to_python(py, x.as_slice().to_vec(), &[x.len()]);
        let parts = (seen.step, seen.time, vector(seen.q)?, vector(seen.v)?);
        py.import("hydrograd._policy")?
            .getattr("Observation")?
            .call1(parts)
    }

    fn try_act(&self, py: Python<'_>, seen: &Observation) -> PyResult<Vec<f64>> {
        let given = self
            .object(py)
            .call_method1("act", (Self::observation(py, seen)?,))?;
        let shape = [Dim::Is(self.controls)];
        Ok(array::array("policy: act", &given, &shape)?.values)
    }

    fn try_act_vjp(
        &self,
        py: Python<'_>,
        seen: &Observation,
        control_bar: &DVector<f64>,
    ) -> PyResult<ActionBar> {
        let object = self.object(py);
        let Some(method) = object.getattr_opt("act_vjp")? else {
            return Err(exception(hydrograd::Error::Unsupported {
                what: "a gradient through this controller".into(),
                why: format!("{} has no method act_vjp", object.get_type().name()?),
                instead: "give it act_vjp(observation, control_bar)".into(),
            }));
        };
        let bar = control_bar.as_slice().to_vec();
        let bar = array::to_python(py, bar, &[control_bar.len()])?;
        let given = method.call1((Self::observation(py, seen)?, bar))?;
        // Without the gains' cotangent a descent on them would stand still, and say nothing.
        let (least, wanted) = match self.gains.is_empty() {
            true => (
                2,
                "a tuple (q_bar, v_bar) or (q_bar, v_bar, gains_bar)".into(),
            ),
            false => (
                3,
                format!(
                    "a tuple (q_bar, v_bar, gains_bar), for it has {} gains (gains_bar=None: they change nothing)",
                    self.gains.len()
                ),
            ),
        };
        let parts: Vec<Bound<'_, PyAny>> = match given.cast::<PyTuple>() {
            Ok(parts) if (least..=3).contains(&parts.len()) => parts.iter().collect(),
            found => {
                let given = match found {
                    Ok(parts) => format!("a tuple of {}", parts.len()),
                    Err(_) => format!("a value of type {}", given.get_type().name()?),
                };
                return Err(input("policy: act_vjp", given, format!("must be {wanted}")));
            }
        };
        let part = |at: usize, name: &str, size: usize| -> PyResult<Vec<f64>> {
            match parts.get(at) {
                Some(part) if !part.is_none() => {
                    let place = format!("policy: act_vjp: {name}");
                    Ok(array::array(&place, part, &[Dim::Is(size)])?.values)
                }
                _ => Ok(Vec::new()),
            }
        };
        Ok(ActionBar {
            q: part(0, "q_bar", self.velocities)?,
            v: part(1, "v_bar", self.velocities)?,
            gains: part(2, "gains_bar", self.gains.len())?,
        })
    }
}

/// What Python gives, or the exception that it raises as the reason for which it doesn't.
fn asked<T>(call: impl FnOnce(Python<'_>) -> PyResult<T>) -> hydrograd::Result<T> {
    ask(call).map_err(|raised| hydrograd::Error::Controller {
        source: Box::new(raised),
    })
}

impl Policy for Controller {
    fn act(&self, observed: &Observation) -> hydrograd::Result<Action> {
        Ok(Action {
            control: asked(|py| self.try_act(py, observed))?,
            ..Action::default()
        })
    }

    fn act_vjp(
        &self,
        observed: &Observation,
        control_bar: &DVector<f64>,
    ) -> hydrograd::Result<ActionBar> {
        asked(|py| self.try_act_vjp(py, observed, control_bar))
    }

    fn gains(&self) -> Vec<f64> {
        self.gains.clone()
    }

    fn with_gains(&self, gains: &[f64]) -> hydrograd::Result<Box<dyn Policy>> {
        asked(|py| {
            let gains = array::to_python(py, gains.to_vec(), &[gains.len()])?;
            let made = with_gains(&self.object(py), gains.as_any())?;
            let mut other = Self::new(&made, (self.controls, self.velocities))?;
            // Nobody else holds the one that was made just now.
            other.object = Pointer::Strong(made.unbind());
            Ok(Box::new(other) as Box<dyn Policy>)
        })
    }
}

/// The controller `policy` with other gains, which it makes itself.
pub fn with_gains<'py>(
    policy: &Bound<'py, PyAny>,
    gains: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    match policy.getattr_opt("with_gains")? {
        Some(method) => method.call1((gains,)),
        None => Err(input(
            "with_gains",
            format!("a controller of type {}", policy.get_type().name()?),
            "must have a method with_gains(gains)",
        )),
    }
}
