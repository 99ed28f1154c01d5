//! Values of objectives of trajectories, and derivatives in both directions.

use super::Rollout;
use crate::array::{self, Dim};
use crate::gradient;
use crate::interrupt::{Progress, ended, followed, short};
use crate::mapping;
use crate::objective::Objective;
use crate::tangents::{self, Along};
use hydrograd::simulate::{Cotangents, Variables};
use nalgebra::DMatrix;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

#[pymethods]
impl Rollout {
    /// Value of an objective.
    fn value(&self, py: Python<'_>, objective: PyRef<'_, Objective>) -> PyResult<f64> {
        let objective = objective.0.clone();
        short(py, || self.inner.value(&objective))
    }

    /// Gradient of an objective, in one reverse sweep. `progress(done, total)` is told the steps gone back, as in `Simulator.rollout`; what it raises ends the sweep and comes out. Ctrl-C ends it.
    #[pyo3(signature = (objective, *, progress=None))]
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        objective: PyRef<'py, Objective>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        use hydrograd::simulate::Objective as _;
        let objective = objective.0.clone();
        let rollout = self.inner.clone();
        let mut progress = Progress::new("gradient: progress", progress, self.steps())?;
        let made = followed(py, &mut progress, move |interrupt| {
            objective.check(&rollout)?;
            rollout.vjp_with(&objective.try_cotangents(&rollout)?, |done| {
                interrupt.at(done)
            })
        });
        let made = ended(progress, made)?;
        gradient::of_rollout(py, &made)
    }

    /// Transpose of the rollout: the gradient of Σ cotangent · δ(observation), for any loss of your own. `q` in the tangent
    /// space of the coordinates and `v` are (N + 1, v_size), `positions` and `rotations` (δR = δθ × R, world axes)
    /// (N + 1, bodies, 3), `controls`, what the loss has of the open-loop ones directly, and `applied_controls`, those with what the controller added, (N, control_size); `observables` has
    /// cotangents of others by name, each in the shape that `observe` gives, but of "q", "rotations" and "site_rotations" in the tangent space, as `q` and `rotations`; `density` what the loss has of the water's density directly. What is None is zero. `progress` is that of `gradient`. Ctrl-C ends it.
    #[pyo3(signature = (*, positions=None, rotations=None, q=None, v=None, controls=None, applied_controls=None, observables=None, density=0.0, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        positions: Option<&Bound<'py, PyAny>>,
        rotations: Option<&Bound<'py, PyAny>>,
        q: Option<&Bound<'py, PyAny>>,
        v: Option<&Bound<'py, PyAny>>,
        controls: Option<&Bound<'py, PyAny>>,
        applied_controls: Option<&Bound<'py, PyAny>>,
        observables: Option<&Bound<'py, PyAny>>,
        density: f64,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut seed: Cotangents = self.inner.zero_cotangents();
        seed.density = density;
        let (states, steps) = (self.steps() + 1, self.steps());
        let bodies = [Dim::Is(self.bodies()), Dim::Is(3)];
        let nv = [Dim::Is(seed.q.nrows())];
        let nu = [Dim::Is(seed.controls.nrows())];
        let parts: [(&str, _, &mut DMatrix<f64>, usize, &[Dim]); 6] = [
            (
                "vjp: positions",
                positions,
                &mut seed.positions,
                states,
                &bodies,
            ),
            (
                "vjp: rotations",
                rotations,
                &mut seed.rotations,
                states,
                &bodies,
            ),
            ("vjp: q", q, &mut seed.q, states, &nv),
            ("vjp: v", v, &mut seed.v, states, &nv),
            ("vjp: controls", controls, &mut seed.controls, steps, &nu),
            (
                "vjp: applied_controls",
                applied_controls,
                &mut seed.applied_controls,
                steps,
                &nu,
            ),
        ];
        for (place, given, part, count, inner) in parts {
            if let Some(given) = given {
                let mut shape = vec![Dim::Is(count)];
                shape.extend(inner);
                *part = array::array(place, given, &shape)?.columns(part.nrows());
            }
        }
        let observables = mapping::named("vjp: observables", "an array", observables)?;
        for (name, given) in observables {
            let place = format!("vjp: observables[{name:?}]");
            // Cotangents live in the tangent space.
            let shape = tangents::tangent_shape(&self.inner, &name)?;
            let rows: usize = shape.iter().product();
            let mut whole = vec![Dim::Is(states)];
            whole.extend(shape.into_iter().map(Dim::Is));
            let columns = array::array(&place, &given, &whole)?.columns(rows);
            seed.observables.insert(name, columns);
        }
        let rollout = self.inner.clone();
        let mut progress = Progress::new("vjp: progress", progress, self.steps())?;
        let made = followed(py, &mut progress, move |interrupt| {
            rollout.vjp_with(&seed, |done| interrupt.at(done))
        });
        let made = ended(progress, made)?;
        gradient::of_rollout(py, &made)
    }

    /// Tangents of the trajectory, the counterpart of `vjp`: how the states change along `controls` (N, control_size), `q` (v_size,) in the tangent space of the
    /// initial coordinates, the initial `v` (v_size,), `parameters` by name, and `gains`; what is None stays. Each may have one more index before its own, for many
    /// directions at once, which cost little more than one. `observables` names others whose tangents are wanted. A `Tangents`. Ctrl-C ends it.
    #[pyo3(signature = (*, controls=None, q=None, v=None, parameters=None, gains=None, observables=None))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        controls: Option<&Bound<'py, PyAny>>,
        q: Option<&Bound<'py, PyAny>>,
        v: Option<&Bound<'py, PyAny>>,
        parameters: Option<&Bound<'py, PyAny>>,
        gains: Option<&Bound<'py, PyAny>>,
        observables: Option<Vec<String>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let along = Along {
            controls,
            q,
            v,
            parameters,
            gains,
        };
        tangents::jvp(py, &self.inner, &along, observables.unwrap_or_default())
    }

    /// Jacobians of the observables `of` ("q" in the tangent space of the coordinates, "rotations" and "site_rotations" as δθ) at `states` (all where None; negative numbers count from the end)
    /// with respect to the `parameters` named, and where True the initial `q` (in its tangent space) and `v`, the `gains`, and the `controls` of all steps: by name an array
    /// (states, …, columns) whose columns come in that order. It costs a few runs, whatever the number of columns. Ctrl-C ends it.
    #[pyo3(signature = (parameters=None, *, q=false, v=false, gains=false, controls=false, of=None, states=None))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        parameters: Option<Vec<String>>,
        q: bool,
        v: bool,
        gains: bool,
        controls: bool,
        of: Option<Vec<String>>,
        states: Option<Vec<isize>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let variables = Variables {
            parameters: parameters.unwrap_or_default(),
            initial_q: q,
            initial_v: v,
            gains,
            controls,
        };
        let of = of.unwrap_or_else(|| vec!["q".into(), "v".into()]);
        tangents::jacobian(py, &self.inner, variables, of, states)
    }

    /// Linearisations x_{n+1} ≈ A_n x_n + B_n u_n of all steps in x = (q, v), coordinates in their tangent space, the scene's controller included: A (N, 2 v_size, 2 v_size)
    /// and B (N, 2 v_size, control_size); with `parameters` also the derivatives with respect to those named (N, 2 v_size, parameters). Steps are taken on all cores.
    #[pyo3(signature = (parameters=None))]
    fn step_jacobians<'py>(
        &self,
        py: Python<'py>,
        parameters: Option<Vec<String>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        tangents::step_jacobians(py, &self.inner, parameters)
    }
}
