//! How simulators are made and made again, and where their runs begin.

use crate::error::input;
use crate::interrupt::{light, long};
use crate::log;
use crate::simulator::Simulator;
use crate::state::State;
use hydrograd::dynamics;
use hydrograd::simulate::Choices;
use nalgebra::DVector;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// A simulator of a scene; Ctrl-C gives it up.
pub fn build(
    py: Python<'_>,
    scene: hydrograd::Scene,
    choices: Choices,
    cache: Option<PathBuf>,
) -> PyResult<Simulator> {
    let (of, folder) = (scene.clone(), cache.clone());
    let bodies = scene.bodies.len();
    let started = Instant::now();
    log::info(py, || format!("simulator: preparing {bodies} bodies"))?;
    let made = long(py, move |_| {
        hydrograd::Simulator::with_choices(&of, choices, folder.as_deref())
    })?;
    log::done(py, started, || {
        format!("simulator: prepared {bodies} bodies")
    })?;
    log::warnings(py, "simulator", || warnings(&made))?;
    Ok(Simulator {
        inner: Arc::new(made),
        scene,
        cache,
        policy: None,
        softness: 1.0,
    })
}

/// What should be known before a run.
pub fn warnings(of: &hydrograd::Simulator) -> Vec<String> {
    let start = of.start_gap_warning().into_iter();
    let start = start.chain(of.start_stiffness_warning());
    of.warnings().iter().cloned().chain(start).collect()
}

/// Scene, choices, folder, parameters, initial q, v and gains, the controller if it is written in Python, and the softness of contact.
pub type Parts = (
    String,
    String,
    Option<PathBuf>,
    Vec<f64>,
    (Vec<f64>, Vec<f64>, Vec<f64>),
    Option<Py<PyAny>>,
    f64,
);

/// A simulator from what `__reduce__` gives.
pub fn rebuild(
    py: Python<'_>,
    toml: &str,
    choices: &str,
    cache: Option<PathBuf>,
    parameters: &[f64],
    start: (Vec<f64>, Vec<f64>, Vec<f64>),
    softness: f64,
) -> PyResult<Simulator> {
    let scene = light(py, || hydrograd::Scene::from_toml(toml, ""))?;
    let choices = serde_json::from_str(choices).map_err(|e| {
        input(
            "pickled simulator: choices",
            e,
            "must come from this version of hydrograd",
        )
    })?;
    let out = build(py, scene, choices, cache)?.softened(softness)?;
    out.changed(|inner| {
        if let Some(values) = inner.parameters().with_values(parameters) {
            inner.set_parameters(values)?;
        }
        inner.set_start(start.0.into(), start.1.into())?;
        match start.2.is_empty() {
            true => Ok(()),
            false => set_gains(inner, &start.2),
        }
    })
}

/// Gives the controller other gains.
pub fn set_gains(simulator: &mut hydrograd::Simulator, gains: &[f64]) -> hydrograd::Result<()> {
    let policy = simulator.policy().with_gains(gains)?;
    simulator.set_policy(policy);
    Ok(())
}

/// Where a run begins.
pub enum Start {
    /// Where the simulator says.
    Scene,
    /// At coordinates and a velocity.
    From(DVector<f64>, DVector<f64>),
    /// At a state.
    At(Py<State>),
}

impl Start {
    /// The state there.
    pub fn state(&self, simulator: &hydrograd::Simulator) -> hydrograd::Result<dynamics::State> {
        match self {
            Self::Scene => simulator.initial(),
            Self::From(q, v) => simulator.state(0, q, v),
            Self::At(state) => state.get().of(simulator),
        }
    }
}
