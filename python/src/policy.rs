//! Controllers written in Python.
//!
//! An exception of one can't pass through a rollout. It waits beside it, the rollout ends at its next step, and
//! whoever started it raises the exception. Exceptions are counted: a call that finds more of them at its end than at
//! its beginning gives no result, so that calls at the same time on one rollout can't take what another one's
//! exception left undone for an answer.

use crate::array::{self, Dim};
use crate::error::{OrRaise, exception, input};
use hydrograd::simulate::{Action, ActionBar, Observation, Policy};
use nalgebra::DVector;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// What the controller of a run has raised.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Exceptions>>);

#[derive(Default)]
struct Exceptions {
    count: u64,
    last: Option<PyErr>,
}

/// The time between two moments of a run.
#[derive(Clone)]
pub struct Watch {
    raised: Raised,
    before: u64,
}

impl Raised {
    fn with<T>(&self, of: impl FnOnce(&mut Exceptions) -> T) -> T {
        of(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn add(&self, error: PyErr) {
        self.with(|all| {
            all.count += 1;
            all.last = Some(error);
        });
    }

    /// From now on.
    pub fn watch(&self) -> Watch {
        Watch {
            raised: self.clone(),
            before: self.with(|all| all.count),
        }
    }
}

impl Watch {
    /// For the progress of a run: not after an exception.
    pub fn go_on(&self) -> ControlFlow<()> {
        if self.raised.with(|all| all.count) > self.before {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// What the run gave, unless its controller raised an exception meanwhile.
    pub fn outcome<T>(&self, py: Python<'_>, done: hydrograd::Result<T>) -> PyResult<T> {
        let last = (self.raised).with(|all| all.last.as_ref().map(|e| e.clone_ref(py)));
        match last {
            Some(error) if self.go_on().is_break() => Err(error),
            _ => done.or_raise(),
        }
    }
}

/// A controller written in Python: an object with `act`, and, to be differentiated, `act_vjp`.
pub struct Controller {
    object: Py<PyAny>,
    controls: usize,
    velocities: usize,
    gains: Vec<f64>,
    raised: Raised,
}

impl Controller {
    /// A controller of a system with so many controls and velocities.
    pub fn new(
        object: &Bound<'_, PyAny>,
        (controls, velocities): (usize, usize),
        raised: &Raised,
    ) -> PyResult<Self> {
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
            object: object.clone().unbind(),
            controls,
            velocities,
            gains,
            raised: raised.clone(),
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
        let given = (self.object.bind(py)).call_method1("act", (Self::observation(py, seen)?,))?;
        let shape = [Dim::Is(self.controls)];
        Ok(array::array("policy: act", &given, &shape)?.values)
    }

    fn try_act_vjp(
        &self,
        py: Python<'_>,
        seen: &Observation,
        control_bar: &DVector<f64>,
    ) -> PyResult<ActionBar> {
        let object = self.object.bind(py);
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
        let parts: Vec<Bound<'_, PyAny>> = match given.cast::<PyTuple>() {
            Ok(parts) if (2..=3).contains(&parts.len()) => parts.iter().collect(),
            _ => {
                return Err(input(
                    "policy: act_vjp",
                    format!("a value of type {}", given.get_type().name()?),
                    "must be a tuple (q_bar, v_bar) or (q_bar, v_bar, gains_bar)",
                ));
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

    /// What Python gives; nothing where it raises an exception, which is kept.
    fn ask<T: Default>(&self, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> T {
        Python::attach(call).unwrap_or_else(|error| {
            self.raised.add(error);
            T::default()
        })
    }
}

impl Policy for Controller {
    fn act(&self, observed: &Observation) -> Action {
        Action {
            control: self.ask(|py| self.try_act(py, observed)),
            ..Action::default()
        }
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> ActionBar {
        self.ask(|py| self.try_act_vjp(py, observed, control_bar))
    }

    fn gains(&self) -> Vec<f64> {
        self.gains.clone()
    }

    /// The object makes the other one: `Simulator.with_gains` asks it, not the simulator's Rust side.
    fn with_gains(&self, _: &[f64]) -> hydrograd::Result<Box<dyn Policy>> {
        Err(hydrograd::Error::Unsupported {
            what: "other gains of a controller written in Python".into(),
            why: "the controller is an object of its own".into(),
            instead: "use Simulator.with_gains".into(),
        })
    }
}
