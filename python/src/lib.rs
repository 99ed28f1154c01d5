//! The Python face of hydrograd: types and arrays in, types and arrays out. No numerics.

mod array;
mod body;
mod contact;
mod control;
mod cost;
mod equations;
mod error;
mod flow;
mod fluid;
mod gradcheck;
mod gradient;
mod identify;
mod interrupt;
mod joint;
mod loads;
mod log;
mod mapping;
mod mesh;
mod mpc;
mod nested;
mod objective;
mod optimize;
mod output;
mod policy;
mod prepare;
mod pressure;
mod robot;
mod rollout;
mod scene;
mod settings;
mod shape;
mod simulation;
mod simulator;
mod state;
mod tangents;
mod tracking;
mod tradeoff;
mod video;

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use simulator::Simulator;
use state::State;
use std::path::PathBuf;

/// Unpickles a simulator: prepares it again.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "what a simulator consists of")]
fn _simulator(
    py: Python<'_>,
    scene: &str,
    settings: &str,
    cache: Option<PathBuf>,
    parameters: Vec<f64>,
    start: (Vec<f64>, Vec<f64>, Vec<f64>),
    policy: Option<Bound<'_, PyAny>>,
    softness: f64,
) -> PyResult<Simulator> {
    let made = prepare::rebuild(py, scene, settings, cache, &parameters, start, softness)?;
    match policy {
        Some(policy) => made.with_policy(&policy),
        None => Ok(made),
    }
}

/// Unpickles a state.
#[pyfunction]
fn _state(
    simulator: Py<Simulator>,
    step: usize,
    q: Vec<f64>,
    y: Vec<f64>,
    held: Vec<bool>,
    mode: usize,
    v: Vec<f64>,
) -> State {
    State::from_parts((simulator, step, q, y, held, mode, v))
}

/// Unpickles a rollout: runs it again.
#[pyfunction]
fn _rollout<'py>(
    simulator: &Bound<'py, Simulator>,
    state: &Bound<'py, State>,
    controls: &Bound<'py, PyArrayDyn<f64>>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = pyo3::types::PyDict::new(simulator.py());
    options.set_item("state", state)?;
    simulator.call_method("rollout", (controls,), Some(&options))
}

/// Runs the command line; its exit code. It is the process's own: Ctrl-C ends it as it does any program. `videos` makes the videos that are asked for: it has `prepare` and `record`.
#[pyfunction]
fn _command(py: Python<'_>, arguments: Vec<std::ffi::OsString>, videos: Py<PyAny>) -> u8 {
    let videos = video::Maker(videos);
    py.detach(|| hydrograd::cli::run_with(arguments, Some(&videos)) as u8)
}

/// Rigid bodies in water, simulated and differentiated; the compiled part of `hydrograd`.
#[pymodule]
fn _hydrograd(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    error::register(m)?;
    m.add_class::<fluid::Fluid>()?;
    m.add_class::<fluid::Contact>()?;
    m.add_class::<body::Body>()?;
    m.add_class::<body::Drag>()?;
    m.add_class::<body::Mimic>()?;
    m.add_class::<body::Passive>()?;
    m.add_class::<body::Servo>()?;
    m.add_class::<shape::Shape>()?;
    m.add_class::<joint::Joint>()?;
    m.add_class::<joint::Motion>()?;
    m.add_class::<scene::Scene>()?;
    m.add_class::<robot::Robot>()?;
    m.add_class::<simulator::Simulator>()?;
    m.add_class::<equations::Equations>()?;
    m.add_class::<state::State>()?;
    m.add_class::<state::Record>()?;
    m.add_class::<rollout::Rollout>()?;
    m.add_class::<loads::Loads>()?;
    m.add_class::<pressure::SurfacePressure>()?;
    m.add_class::<objective::Objective>()?;
    shape::register(m)?;
    joint::register(m)?;
    m.add_function(wrap_pyfunction!(_simulator, m)?)?;
    m.add_function(wrap_pyfunction!(_state, m)?)?;
    m.add_function(wrap_pyfunction!(_rollout, m)?)?;
    m.add_function(wrap_pyfunction!(tradeoff::tradeoff, m)?)?;
    m.add_function(wrap_pyfunction!(_command, m)?)?;
    m.add_function(wrap_pyfunction!(nested::_nested, m)?)?;
    m.add_function(wrap_pyfunction!(robot::inspect_robot, m)?)?;
    control::register(m)?;
    m.add_class::<mpc::Mpc>()?;
    identify::register(m)?;
    optimize::register(m)?;
    objective::register(m)
}
