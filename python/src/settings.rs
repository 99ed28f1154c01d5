//! Settings of a simulator from keywords.

use crate::array::{Dim, array};
use crate::error::input;
use hydrograd::boundary::{Method, OneBody};
use hydrograd::simulate::Backend;
use hydrograd::{Fidelity, Scene, Settings, dynamics::Integrator};
use pyo3::prelude::*;

const FIDELITIES: [(&str, Fidelity); 4] = [
    ("isolated", Fidelity::Isolated),
    ("reduced", Fidelity::Reduced),
    ("auto", Fidelity::Auto),
    ("full", Fidelity::Full),
];

const INTEGRATORS: [(&str, Integrator); 5] = [
    ("momentum-euler", Integrator::MomentumEuler),
    ("midpoint", Integrator::Midpoint),
    ("rk2", Integrator::Rk2),
    ("rk4", Integrator::Rk4),
    ("velocity-euler", Integrator::VelocityEuler),
];

const METHODS: [(&str, OneBody, Option<Method>); 5] = [
    ("auto", OneBody::Auto, None),
    ("exact", OneBody::Exact, None),
    ("panel", OneBody::Panel, None),
    ("mfs-vertex", OneBody::Mfs, Some(Method::MfsVertex)),
    ("mfs-face", OneBody::Mfs, Some(Method::MfsFace)),
];

/// The name of a fidelity.
pub fn fidelity_name(of: Fidelity) -> &'static str {
    let found = FIDELITIES.iter().find(|(_, f)| *f == of);
    found.map_or("", |(name, _)| name)
}

/// The name of an integrator.
pub fn integrator_name(of: Integrator) -> &'static str {
    let found = INTEGRATORS.iter().find(|(_, f)| *f == of);
    found.map_or("", |(name, _)| name)
}

const BACKENDS: [(&str, Backend); 2] = [("cpu", Backend::Cpu), ("gpu", Backend::Gpu)];

/// The name of a backend.
pub fn backend_name(of: Backend) -> &'static str {
    let found = BACKENDS.iter().find(|(_, b)| *b == of);
    found.map_or("", |(name, _)| name)
}

fn unknown<'a>(field: &str, given: &str, names: impl Iterator<Item = &'a str>) -> PyErr {
    let names: Vec<String> = names.map(|n| format!("{n:?}")).collect();
    input(
        format!("simulator: {field}"),
        format!("{given:?}"),
        format!("must be one of {}", names.join(", ")),
    )
}

fn positive(field: &str, value: f64) -> PyResult<f64> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(input(
        format!("simulator: {field}"),
        value,
        "must be finite and positive",
    ))
}

/// What the keywords of a simulator say; what isn't given follows the scene.
pub struct Keywords<'a> {
    /// Time step, s.
    pub dt: Option<f64>,
    /// How much of the coupling is modelled.
    pub fidelity: Option<&'a str>,
    /// How one body is solved.
    pub method: Option<&'a str>,
    /// Residual of iterative solves.
    pub tolerance: Option<f64>,
    /// Time integrator.
    pub integrator: Option<&'a str>,
    /// Faces of shapes by formula.
    pub faces: Option<usize>,
    /// Error that `reduced` and `auto` aim at.
    pub accuracy: Option<f64>,
    /// Points of a compressed body.
    pub rank: Option<usize>,
    /// Smallest gap resolved, m.
    pub resolved_gap: Option<f64>,
    /// What computes the coupling.
    pub backend: Option<&'a str>,
}

impl Keywords<'_> {
    /// The settings for a scene.
    pub fn settings(&self, scene: &Scene) -> PyResult<Settings> {
        let mut out = Settings::for_scene(scene);
        if let Some(dt) = self.dt {
            out = out.time_step(positive("dt", dt)?);
        }
        if let Some(name) = self.fidelity {
            let found = FIDELITIES.iter().find(|(n, _)| *n == name);
            let (_, fidelity) =
                found.ok_or_else(|| unknown("fidelity", name, FIDELITIES.iter().map(|f| f.0)))?;
            out = out.fidelity(*fidelity);
        }
        if let Some(name) = self.integrator {
            let found = INTEGRATORS.iter().find(|(n, _)| *n == name);
            let (_, integrator) = found
                .ok_or_else(|| unknown("integrator", name, INTEGRATORS.iter().map(|f| f.0)))?;
            out = out.integrator(*integrator);
        }
        if let Some(name) = self.method {
            let found = METHODS.iter().find(|(n, ..)| *n == name);
            let (_, one, method) =
                found.ok_or_else(|| unknown("method", name, METHODS.iter().map(|f| f.0)))?;
            out = match method {
                Some(method) => out.method(*method),
                None => out.one_body(*one),
            };
        }
        if let Some(tolerance) = self.tolerance {
            out = out.tolerance(positive("tolerance", tolerance)?);
        }
        if let Some(faces) = self.faces {
            out = out.faces(faces);
        }
        if let Some(accuracy) = self.accuracy {
            out = out.accuracy(positive("accuracy", accuracy)?);
        }
        if let Some(rank) = self.rank {
            out = out.rank(rank);
        }
        if let Some(gap) = self.resolved_gap {
            out = out.resolved_gap(positive("resolved_gap", gap)?);
        }
        if let Some(name) = self.backend {
            let found = BACKENDS.iter().find(|(n, _)| *n == name);
            let (_, backend) =
                found.ok_or_else(|| unknown("backend", name, BACKENDS.iter().map(|b| b.0)))?;
            out = out.backend(*backend);
        }
        Ok(out)
    }
}

/// A row of `n` numbers, or `default`.
pub fn row_or(
    place: &str,
    given: Option<&Bound<'_, PyAny>>,
    default: &nalgebra::DVector<f64>,
) -> PyResult<nalgebra::DVector<f64>> {
    match given {
        Some(given) => Ok(array(place, given, &[Dim::Is(default.len())])?
            .values
            .into()),
        None => Ok(default.clone()),
    }
}
