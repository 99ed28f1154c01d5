//! Settings of a simulator from keywords.

use crate::array::{Dim, array};
use crate::error::input;
use hydrograd::Settings;
use pyo3::prelude::*;
use std::str::FromStr;
use strum::VariantArray;

/// The choice of a list by its name; `place` is named where there is none.
pub fn named<T: VariantArray + FromStr + Into<&'static str> + Copy>(
    place: &str,
    given: &str,
) -> PyResult<T> {
    given.parse().map_err(|_| {
        let names = T::VARIANTS.iter().map(|v| format!("{:?}", (*v).into()));
        input(
            place,
            format!("{given:?}"),
            format!("must be one of {}", names.collect::<Vec<_>>().join(", ")),
        )
    })
}

fn choice<T: VariantArray + FromStr + Into<&'static str> + Copy>(
    field: &str,
    given: Option<&str>,
) -> PyResult<Option<T>> {
    let place = format!("simulator: {field}");
    given.map(|name| named(&place, name)).transpose()
}

fn positive(field: &str, value: Option<f64>) -> PyResult<Option<f64>> {
    match value.filter(|x| !(*x > 0.0 && x.is_finite())) {
        None => Ok(value),
        Some(wrong) => Err(input(
            format!("simulator: {field}"),
            wrong,
            "must be finite and positive",
        )),
    }
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
    /// Whether gaps that compressed bodies or panels don't resolve have films: unless told not to.
    pub films: Option<bool>,
    /// How compressed bodies are coupled.
    pub exchange: Option<&'a str>,
    /// Shapes with respect to which gradients are wanted.
    pub shape_parameters: Option<Vec<String>>,
    /// What computes the coupling.
    pub backend: Option<&'a str>,
}

impl Keywords<'_> {
    /// The settings.
    pub fn settings(self) -> PyResult<Settings> {
        Ok(Settings {
            time_step: positive("dt", self.dt)?,
            fidelity: choice("fidelity", self.fidelity)?,
            integrator: choice("integrator", self.integrator)?,
            method: choice("method", self.method)?,
            tolerance: positive("tolerance", self.tolerance)?,
            faces: self.faces,
            accuracy: positive("accuracy", self.accuracy)?,
            rank: self.rank,
            resolved_gap: positive("resolved_gap", self.resolved_gap)?,
            films: self.films,
            exchange: choice("exchange", self.exchange)?,
            shape_parameters: self.shape_parameters,
            backend: choice("backend", self.backend)?,
            ..Settings::default()
        })
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
