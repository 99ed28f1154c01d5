//! Videos of the command line's runs: made in Python, of its replays.

use crate::error::own;
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use hydrograd::cli::{Shown, Video, Videos};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// An object of Python with `prepare(**video)` and `record(rollout, **video)`.
pub struct Maker(pub Py<PyAny>);

impl Maker {
    /// What is asked for, as `hydrograd.record` takes it.
    fn keywords<'py>(py: Python<'py>, video: &Video) -> PyResult<Bound<'py, PyDict>> {
        let shows = |what| video.show.contains(&what);
        let out = PyDict::new(py);
        out.set_item("file", &video.file)?;
        out.set_item("fps", video.frames_per_second)?;
        out.set_item("speed", video.speed)?;
        out.set_item("size", (video.size[0], video.size[1]))?;
        out.set_item("view_from", video.view_from)?;
        out.set_item("zoom", video.zoom)?;
        out.set_item("follow", &video.follow)?;
        out.set_item("panel", shows(Shown::Panel))?;
        out.set_item("forces", shows(Shown::Forces))?;
        out.set_item("streamlines", shows(Shown::Streamlines))?;
        match shows(Shown::Hydrostatic) {
            true => out.set_item("pressure", "hydrostatic")?,
            false => out.set_item("pressure", shows(Shown::Pressure))?,
        }
        Ok(out)
    }
}

/// An exception in words: of those that are meant for users the message alone.
fn words(py: Python<'_>, error: &PyErr) -> String {
    let meant = own(py, error) || error.is_instance_of::<pyo3::exceptions::PyImportError>(py);
    match meant {
        true => error.value(py).to_string(),
        false => error.to_string(),
    }
}

impl Videos for Maker {
    fn prepare(&self, video: &Video) -> Result<(), String> {
        Python::attach(|py| {
            let made = Self::keywords(py, video)
                .and_then(|keywords| self.0.call_method(py, "prepare", (), Some(&keywords)));
            made.map(|_| ()).map_err(|e| words(py, &e))
        })
    }

    fn record(&self, rollout: hydrograd::Rollout, video: &Video) -> Result<Vec<PathBuf>, String> {
        Python::attach(|py| {
            let record = || {
                let inner = rollout.simulator().clone();
                let simulator = Simulator {
                    scene: inner.scene().clone(),
                    inner: Arc::new(inner),
                    cache: None,
                    policy: None,
                    softness: 1.0,
                };
                let simulator = Bound::new(py, simulator)?;
                let rollout = Rollout::new(&simulator, rollout);
                let keywords = Self::keywords(py, video)?;
                let made = self
                    .0
                    .call_method(py, "record", (rollout,), Some(&keywords))?;
                made.extract(py)
            };
            record().map_err(|e: PyErr| words(py, &e))
        })
    }
}
