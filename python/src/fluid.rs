//! The water, and how surfaces touch.

use crate::array::or_zeros;
use hydrograd::scene;
use pyo3::prelude::*;

/// The fluid around the bodies: `density` in kg/m³ (default 998, fresh water at 20 °C; 0 is no fluid) and a uniform
/// `current` in m/s, world axes.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Fluid(pub hydrograd::Fluid);

/// Density and current.
type Parts = (f64, (f64, f64, f64));

#[pymethods]
impl Fluid {
    #[new]
    #[pyo3(signature = (density=998.0, current=None))]
    fn new(density: f64, current: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self(hydrograd::Fluid {
            density,
            current: or_zeros("fluid: current", current)?,
        }))
    }

    /// Density, kg/m³.
    #[getter]
    fn density(&self) -> f64 {
        self.0.density
    }

    /// Uniform steady current, m/s, world axes.
    #[getter]
    fn current(&self) -> (f64, f64, f64) {
        self.0.current.into()
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.0.current;
        format!(
            "Fluid(density={:?}, current=({x:?}, {y:?}, {z:?}))",
            self.0.density
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, Parts) {
        let fluid = slf.get();
        (
            slf.get_type().into_any(),
            (fluid.density(), fluid.current()),
        )
    }
}

/// Contact between convex bodies and with walls: `stiffness` in N/m, `dissipation` in s/m, the coefficient of `friction`,
/// `torsional_friction` against spinning and `rolling_friction` (torque over normal force, m), the `gap` at which surfaces touch and half the `width` over which the force sets in, in m, and the `stiction_speed`
/// in m/s. What is None is chosen for the scene.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Contact(pub scene::Contact);

#[pymethods]
impl Contact {
    #[new]
    #[pyo3(signature = (
        *, stiffness=None, dissipation=0.5, friction=0.5, torsional_friction=0.0, rolling_friction=0.0, gap=None, width=None,
        stiction_speed=1e-3
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "one per keyword of the constructor"
    )]
    fn new(
        stiffness: Option<f64>,
        dissipation: f64,
        friction: f64,
        torsional_friction: f64,
        rolling_friction: f64,
        gap: Option<f64>,
        width: Option<f64>,
        stiction_speed: f64,
    ) -> Self {
        Self(scene::Contact {
            stiffness,
            dissipation,
            friction,
            torsional_friction,
            rolling_friction,
            gap,
            width,
            stiction_speed,
        })
    }

    fn __repr__(&self) -> String {
        let c = &self.0;
        let chosen = |value: Option<f64>| value.map_or("None".into(), |v| format!("{v:?}"));
        format!(
            "Contact(stiffness={}, dissipation={:?}, friction={:?}, torsional_friction={:?}, rolling_friction={:?}, gap={}, width={}, \
             stiction_speed={:?})",
            chosen(c.stiffness),
            c.dissipation,
            c.friction,
            c.torsional_friction,
            c.rolling_friction,
            chosen(c.gap),
            chosen(c.width),
            c.stiction_speed
        )
    }
}
