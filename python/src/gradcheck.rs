//! The check of a simulator's gradients.

use crate::error::internal;
use crate::interrupt::long;
use crate::simulator::Simulator;
use hydrograd::simulate::gradcheck::{GradcheckSettings, gradcheck};
use hydrograd::simulate::growth::growth;
use pyo3::prelude::*;

/// Report and growth, as dictionaries.
pub fn check<'py>(
    py: Python<'py>,
    simulator: &Simulator,
    steps: usize,
    directions: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyAny>> {
    let mut inner = hydrograd::Simulator::clone(&simulator.inner);
    let settings = GradcheckSettings {
        steps,
        directions,
        seed,
        timings: 0,
        enough: None,
    };
    let made = long(py, move |_| {
        let growth = growth(&inner, steps)?;
        Ok((gradcheck(&mut inner, &settings)?, growth))
    })?;
    let text = |value: serde_json::Result<String>| value.map_err(|e| internal(&e.to_string()));
    let loads = py.import("json")?.getattr("loads")?;
    let report = loads.call1((text(serde_json::to_string(&made.0))?,))?;
    for timing in ["forward_seconds", "gradient_seconds", "ratio"] {
        report.del_item(timing)?;
    }
    report.set_item(
        "growth",
        loads.call1((text(serde_json::to_string(&made.1))?,))?,
    )?;
    report.set_item("advice", made.1.advice())?;
    Ok(report)
}
