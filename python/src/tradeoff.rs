//! Time against error for Python: an instance of the data class in `hydrograd/_tradeoff.py`.

use crate::error::{counts, internal};
use crate::interrupt::long;
use crate::scene::{Scene, copied};
use crate::settings::named;
use hydrograd::tradeoff::{TradeoffSettings, measure};
use pyo3::prelude::*;
use std::str::FromStr;
use strum::VariantArray;

/// The choices of a list by their names.
fn all<T: VariantArray + FromStr + Into<&'static str> + Copy>(
    field: &str,
    names: Option<Vec<String>>,
) -> PyResult<Vec<T>> {
    let place = format!("tradeoff: {field}");
    let names = names.unwrap_or_default();
    names.iter().map(|name| named(&place, name)).collect()
}

/// Measures a scene's time per step against its error, over everything that can be chosen: a `Tradeoff`.
///
/// Each fidelity, method for a body alone, number of faces, of points (`ranks`) and accuracy of compressed bodies, tolerance,
/// integrator and time step (s) is varied around the scene's own choice, or around the first value of a list that is given;
/// with `full_product` every combination is measured. Errors are against coupled panels on finer and finer meshes (added
/// mass) and against compressed bodies of high accuracy with a quarter of the time step (accelerations, and end states
/// after `steps` steps). Configurations are timed one after another on this machine, so leave it alone meanwhile. `budget` is
/// the time for all this, s; what it has no time for is in `left_out`. With `reference_faces` faces a body the reference
/// takes the time it needs. Ctrl-C ends it.
#[pyfunction]
#[pyo3(signature = (
    scene, *, fidelities=None, methods=None, faces=None, ranks=None, accuracies=None, tolerances=None, integrators=None,
    time_steps=None, full_product=false, steps=None, reference_faces=None, budget=120.0
))]
#[expect(clippy::too_many_arguments, reason = "one per keyword")]
pub fn tradeoff<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    fidelities: Option<Vec<String>>,
    methods: Option<Vec<String>>,
    #[pyo3(from_py_with = counts::lists::faces)] faces: Option<Vec<usize>>,
    #[pyo3(from_py_with = counts::lists::ranks)] ranks: Option<Vec<usize>>,
    accuracies: Option<Vec<f64>>,
    tolerances: Option<Vec<f64>>,
    integrators: Option<Vec<String>>,
    time_steps: Option<Vec<f64>>,
    full_product: bool,
    #[pyo3(from_py_with = counts::optional::steps)] steps: Option<usize>,
    #[pyo3(from_py_with = counts::optional::reference_faces)] reference_faces: Option<usize>,
    budget: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let settings = TradeoffSettings {
        fidelities: all("fidelities", fidelities)?,
        methods: all("methods", methods)?,
        faces: faces.unwrap_or_default(),
        ranks: ranks.unwrap_or_default(),
        accuracies: accuracies.unwrap_or_default(),
        tolerances: tolerances.unwrap_or_default(),
        integrators: all("integrators", integrators)?,
        time_steps: time_steps.unwrap_or_default(),
        full_product,
        steps,
        reference_faces,
        budget: Some(budget),
    };
    let scene = copied(scene)?;
    let text = long(py, move |interrupt| {
        let found = measure(&scene, &settings, |_| interrupt.check())?;
        Ok(serde_json::to_string(&found))
    })?;
    let text = text.map_err(|e| internal(&e.to_string()))?;
    py.import("hydrograd._tradeoff")?
        .getattr("Tradeoff")?
        .call_method1("_from_json", (text,))
}
