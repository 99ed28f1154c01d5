//! What happens, told to Python's `logging` under the name "hydrograd": before and after work, never within it.

use crate::interrupt::short;
use pyo3::prelude::*;
use std::time::Instant;

/// Levels of `logging`.
#[derive(Clone, Copy)]
enum Level {
    Info = 20,
    Warning = 30,
}

/// The logger, where somebody listens at this level: without a handler nothing is worked out, let alone written.
fn listened(py: Python<'_>, level: Level) -> PyResult<Option<Bound<'_, PyAny>>> {
    let logger = py
        .import("logging")?
        .call_method1("getLogger", ("hydrograd",))?;
    let heard = logger
        .call_method1("isEnabledFor", (level as i32,))?
        .is_truthy()?
        && logger.call_method0("hasHandlers")?.is_truthy()?;
    Ok(heard.then_some(logger))
}

fn tell(logger: &Bound<'_, PyAny>, level: Level, message: String) -> PyResult<()> {
    logger.call_method1("log", (level as i32, "%s", message))?;
    Ok(())
}

/// Says what goes on.
pub fn info(py: Python<'_>, message: impl FnOnce() -> String) -> PyResult<()> {
    match listened(py, Level::Info)? {
        Some(logger) => tell(&logger, Level::Info, message()),
        None => Ok(()),
    }
}

/// Says that something took its time.
pub fn done(py: Python<'_>, since: Instant, what: impl FnOnce() -> String) -> PyResult<()> {
    info(py, || {
        format!("{} in {:.3} s", what(), since.elapsed().as_secs_f64())
    })
}

/// Passes warnings on, found without the interpreter's lock, and only where they are listened to.
pub fn warnings(
    py: Python<'_>,
    of: &str,
    find: impl FnOnce() -> Vec<String> + Send,
) -> PyResult<()> {
    let Some(logger) = listened(py, Level::Warning)? else {
        return Ok(());
    };
    for warning in short(py, || Ok(find()))? {
        tell(&logger, Level::Warning, format!("{of}: {warning}"))?;
    }
    Ok(())
}
