//! What simulators do: the methods of their class. Here how they are made, and what was chosen.

mod names;
mod run;
mod step;
mod variants;

use crate::error::{OrRaise, counts, input};
use crate::interrupt::short;
use crate::prepare::{Parts, build, warnings};
use crate::scene::{Scene, copied};
use crate::settings::Keywords;
use crate::simulator::Simulator;
use nalgebra::DVector;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;

#[pymethods]
impl Simulator {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.policy)
    }

    #[new]
    #[pyo3(signature = (
        scene, dt=None, *, fidelity=None, method=None, tolerance=None, integrator=None, faces=None, accuracy=None,
        rank=None, resolved_gap=None, films=None, exchange=None, shape_parameters=None, cache=None, backend=None
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "one per keyword of the constructor"
    )]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, Scene>,
        dt: Option<f64>,
        fidelity: Option<&str>,
        method: Option<&str>,
        tolerance: Option<f64>,
        integrator: Option<&str>,
        #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
        accuracy: Option<f64>,
        #[pyo3(from_py_with = counts::optional::rank)] rank: Option<usize>,
        resolved_gap: Option<f64>,
        films: Option<bool>,
        exchange: Option<&str>,
        shape_parameters: Option<Vec<String>>,
        cache: Option<PathBuf>,
        backend: Option<&str>,
    ) -> PyResult<Self> {
        let keywords = Keywords {
            dt,
            fidelity,
            method,
            tolerance,
            integrator,
            faces,
            accuracy,
            rank,
            resolved_gap,
            films,
            exchange,
            shape_parameters,
            backend,
        };
        let scene = copied(scene)?;
        let choices = keywords.settings()?.resolve(&scene);
        build(py, scene, choices, cache)
    }

    /// The scene that it was made from.
    #[getter]
    fn scene(&self) -> Scene {
        Scene(self.scene.clone())
    }

    /// The fidelity in use: what was asked for, or what "auto" chose.
    #[getter]
    fn fidelity(&self) -> &'static str {
        self.inner.fidelity().into()
    }

    /// What computes the coupling: "cpu" or "gpu".
    #[getter]
    fn backend(&self) -> &'static str {
        self.inner.backend().backend_used.into()
    }

    /// The integrator.
    #[getter]
    fn integrator(&self) -> &'static str {
        self.inner.choices().integrator.into()
    }

    /// What was chosen, and why: by "auto", and of an integrator that stands in for the default, which doesn't solve contact.
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.inner.reasons().to_vec()
    }

    /// The gaps at which surfaces are taken to touch, m, by pair of names: of two bodies, or of one and None for a wall. Empty where the scene
    /// has no contact.
    #[getter]
    fn contact_gaps(&self) -> HashMap<(String, Option<String>), f64> {
        let names = self.inner.names();
        let gaps = self.inner.contact_gaps().into_iter();
        gaps.map(|g| {
            (
                (
                    names[g.first].to_string(),
                    g.second.map(|b| names[b].to_string()),
                ),
                g.gap,
            )
        })
        .collect()
    }

    /// What should be known about the scene and its start, with names and numbers.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        short(py, || Ok(warnings(&self.inner)))
    }

    fn __repr__(&self) -> String {
        format!(
            "Simulator(bodies={:?}, dt={:?} s, fidelity={:?}, integrator={:?})",
            self.inner.names(),
            self.dt(),
            self.fidelity(),
            self.integrator()
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_simulator")?;
        let choices = serde_json::to_string(self.inner.choices()).map_err(|e| {
            input(
                "simulator: choices",
                e,
                "must be numbers that JSON can hold",
            )
        })?;
        let (q, v) = self.inner.start();
        let list = |x: &DVector<f64>| x.as_slice().to_vec();
        let policy = self.policy(py);
        let gains = match policy {
            Some(_) => Vec::new(),
            None => self.inner.policy().gains(),
        };
        let start = (list(q), list(v), gains);
        let parameters = self.inner.parameters().to_vec();
        let scene = self.scene.to_toml().or_raise()?;
        Ok((
            make,
            (
                scene,
                choices,
                self.cache.clone(),
                parameters,
                start,
                policy,
                self.softness,
            ),
        ))
    }
}
