//! Simulators: the class; its methods stand in `simulation`.

use crate::interrupt::short;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene made ready: shapes discretised, bodies joined, coupling prepared. It doesn't change.
///
/// `dt` is the time step, s (default: the scene's). `fidelity` says how much of the coupling through the water is
/// computed: "isolated", "reduced", "auto" (the default) or "full"; `method` how each body alone is solved: "auto", "exact", "panel",
/// "mfs-vertex" or "mfs-face". `integrator`: "momentum-euler", "energy-euler", "midpoint", "rk2", "rk4" or "velocity-euler". `tolerance` is the
/// relative residual at which iterative solves stop ("full"), `faces` the number of triangles of shapes by formula.
/// `accuracy` (relative), `rank` (points a body) and `resolved_gap` (m) belong to "reduced" and "auto", `films` (False: the water in gaps that aren't
/// resolved isn't added as films) to them and to "full" by panels. `exchange` says how compressed bodies are coupled: "factor", "products" (many bodies, about linear in their number), or "auto" (the default). `shape_parameters` are names of shape parameters ("finger.size.y"), or what these begin with ("finger"; "hull.vertex" for all
/// vertices of a mesh), or "*": gradients have entries for them. `cache` is a folder that keeps compressed bodies. `backend`: "cpu" (the default), or "gpu" in a build with the feature of that name.
#[pyclass(frozen, module = "hydrograd")]
pub struct Simulator {
    /// The simulator of the Rust side.
    pub inner: Arc<hydrograd::Simulator>,
    /// What it was made from.
    pub scene: hydrograd::Scene,
    /// Where compressed bodies are kept.
    pub cache: Option<PathBuf>,
    /// Its controller, if that is written in Python.
    pub policy: Option<Py<PyAny>>,
    /// How many times softer its contact is than the scene's.
    pub softness: f64,
}

impl Simulator {
    /// A clone with something changed.
    pub fn changed(
        &self,
        change: impl FnOnce(&mut hydrograd::Simulator) -> hydrograd::Result<()> + Send,
    ) -> PyResult<Self> {
        Python::attach(|py| {
            let inner = short(py, || {
                let mut inner = hydrograd::Simulator::clone(&self.inner);
                change(&mut inner)?;
                Ok(inner)
            })?;
            Ok(Self {
                inner: Arc::new(inner),
                scene: self.scene.clone(),
                cache: self.cache.clone(),
                policy: self.policy.as_ref().map(|p| p.clone_ref(py)),
                softness: self.softness,
            })
        })
    }

    /// With contact softer by a factor.
    pub fn softened(&self, factor: f64) -> PyResult<Self> {
        let mut out = self.changed(|inner| inner.soften_contact(factor))?;
        out.softness *= factor;
        Ok(out)
    }

    /// Number of controls a step.
    pub fn controls_size(&self) -> usize {
        self.inner.system().controls
    }
}
