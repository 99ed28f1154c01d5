//! The water around a trajectory: its velocity, pressure and potential, anywhere, on surfaces and at sensors, and in the smallest gap.

use super::{Numbers, Rollout};
use crate::array;
use crate::error::counts;
use crate::flow;
use crate::interrupt::long;
use crate::pressure::SurfacePressure;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[pymethods]
impl Rollout {
    /// The water's pressure on the surface of every body in it at state `state`, as the step there starts: one a body. It takes solves of its own. Negative numbers count
    /// states from the end. At the last state (-1) no step begins, as of `loads`: the water answers accelerations without controls and contact.
    fn pressure(&self, py: Python<'_>, state: isize) -> PyResult<Vec<SurfacePressure>> {
        let at = array::numbered(state, self.inner.states().len(), "state")?;
        let inner = self.inner.clone();
        let made = long(py, move |_| inner.pressure(at))?;
        Ok(made.into_iter().map(SurfacePressure).collect())
    }

    /// The water's velocity at `points` (n, 3), m, at state `state`: (n, 3), m/s, world axes, the current included. It takes a
    /// solve. Points within a body, behind a wall, or too near to an edge or to two
    /// surfaces at once are refused: `flow_resolved` tells them apart. Negative numbers count states from the end.
    fn flow<'py>(&self, py: Python<'py>, state: isize, points: &Bound<'py, PyAny>) -> Numbers<'py> {
        flow::flow(py, &self.inner, state, points)
    }

    /// The pressure of the flow at `points` (n, 3), m, at state `state`: (n,), Pa, zero far away, that of the water at rest left out. Points as of `flow`.
    fn flow_pressure<'py>(
        &self,
        py: Python<'py>,
        state: isize,
        points: &Bound<'py, PyAny>,
    ) -> Numbers<'py> {
        flow::flow_pressure(py, &self.inner, state, points)
    }

    /// Whether `flow` knows the velocity at each of `points` (n, 3), m, at state `state`: (n,).
    fn flow_resolved<'py>(
        &self,
        py: Python<'py>,
        state: isize,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        flow::flow_resolved(py, &self.inner, state, points)
    }

    /// The potential φ of the flow that the bodies make at `points` (n, 3), m, at state `state`: (n,), m²/s, velocity −∇φ, zero far away, without the current. Points as of `flow`.
    fn potential<'py>(
        &self,
        py: Python<'py>,
        state: isize,
        points: &Bound<'py, PyAny>,
    ) -> Numbers<'py> {
        flow::potential(py, &self.inner, state, points)
    }

    /// The water's velocity at sensors at the states 0 … N, (N + 1, n, 3), m/s, world axes: at `points` (n, 3), m, fixed in the world, or in the frames of `bodies`, one for all or one each, by number or
    /// name, None of what is fixed in the world. Sensors stand at least three quarters of an edge off all surfaces. A loss of it has gradients: `sensor_vjp`.
    #[pyo3(signature = (points, bodies=None))]
    fn sensor_flow<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        bodies: Option<&Bound<'py, PyAny>>,
    ) -> Numbers<'py> {
        flow::sensor_flow(py, &self.inner, points, bodies)
    }

    /// The flow's pressure at sensors, given as of `sensor_flow`, at the states 0 … N, (N + 1, n), Pa, zero far away, that of the water at rest left out; with the mean accelerations over
    /// the step that starts there, as the observable "accelerations" has them.
    #[pyo3(signature = (points, bodies=None))]
    fn sensor_pressure<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        bodies: Option<&Bound<'py, PyAny>>,
    ) -> Numbers<'py> {
        flow::sensor_pressure(py, &self.inner, points, bodies)
    }

    /// Transpose of what sensors read: from cotangents `flow` (N + 1, n, 3) and `pressure` (N + 1, n) the keywords of `vjp` that they ask for, `positions`, `rotations`, `observables` and `density`:
    /// `rollout.vjp(**rollout.sensor_vjp(points, flow=bar))`. States without cotangents cost nothing.
    #[pyo3(signature = (points, bodies=None, *, flow=None, pressure=None))]
    fn sensor_vjp<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        bodies: Option<&Bound<'py, PyAny>>,
        flow: Option<&Bound<'py, PyAny>>,
        pressure: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        flow::sensor_vjp(py, &self.inner, points, bodies, flow, pressure)
    }

    /// Lines along the water's velocity at state `state` through `seeds` (n, 3), m, a dictionary each: `points` (k, 3) downstream, `velocities` (k, 3) there, which of them is the `seed`, and why it `ends`
    /// upstream and downstream: "length" (as long as `length`, m, each way), "box" (at the box `within`, two corners (3,)), "body …" or "wall …" (where the flow isn't known any more), "still",
    /// "steps" (more than `most_steps`); None where it doesn't go, with `way` "forward" or "backward". `tolerance`, m, is the error of a step.
    #[pyo3(signature = (state, seeds, length, *, way="both", within=None, tolerance=None, most_steps=2000))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn streamlines<'py>(
        &self,
        py: Python<'py>,
        state: isize,
        seeds: &Bound<'py, PyAny>,
        length: f64,
        way: &str,
        within: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
        tolerance: Option<f64>,
        #[pyo3(from_py_with = counts::most_steps)] most_steps: usize,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let drawn = flow::Drawn {
            length,
            tolerance,
            most_steps,
            within,
            way: way.into(),
        };
        flow::streamlines(py, &self.inner, state, seeds, drawn)
    }

    /// The ways of tracers that go with the water from `seeds` (n, 3), m, at state `start` to state `stop`, a dictionary each: `points` (k, 3) at the states from the first one on, `velocities` (k, 3)
    /// there, `times` (k,), s, and why it comes to its `end`: "length" (at `stop`), "body …" or "wall …". Negative numbers count states from the end.
    #[pyo3(signature = (seeds, start=0, stop=-1), text_signature = "($self, seeds, start=0, stop=-1)")]
    fn path_lines<'py>(
        &self,
        py: Python<'py>,
        seeds: &Bound<'py, PyAny>,
        start: isize,
        stop: isize,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        flow::path_lines(py, &self.inner, seeds, (start, stop))
    }

    /// `flow` where `flow_resolved`, with the solves of one: velocities (n, 3), m/s, zero where they aren't known, and whether they are (n,).
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn known_flow<'py>(
        &self,
        py: Python<'py>,
        state: isize,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArray1<bool>>)> {
        flow::known_flow(py, &self.inner, state, points)
    }

    /// The water across the smallest gap of the trajectory, beside that of coupled panels: a dictionary with `time` (s), `gap` (m), `bodies` (names; of
    /// the second None for a wall), `added_mass` (along the gap, by this rollout and by panels, kg), `slope` (the same of its slope, kg/m),
    /// `added_mass_error` and `force_error` (relative), `force_share` (the force by panels as a part of M u²/2h, that of an added mass M that goes as the inverse
    /// of the gap h, at a speed u across it) and `faces` (of the panels). None where there is no gap, no water, and where the rollout is by coupled
    /// panels already. It takes their setup and a solve.
    fn check_gap<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let inner = self.inner.clone();
        let Some(check) = long(py, move |_| inner.check_gap())? else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        out.set_item("added_mass_error", check.added_mass_error())?;
        out.set_item("force_error", check.force_error())?;
        out.set_item("force_share", check.force_share())?;
        out.set_item("time", check.time)?;
        out.set_item("gap", check.gap)?;
        out.set_item("bodies", check.bodies)?;
        out.set_item("added_mass", check.added_mass)?;
        out.set_item("slope", check.slope)?;
        out.set_item("faces", check.faces)?;
        Ok(Some(out))
    }

    /// Which of inertia and viscosity rules the water in the smallest gap of the trajectory, whether or not viscous water acts there: a dictionary with `time`
    /// (s), `gap` (m), `bodies` (names; of the second None for a wall), `speed` (the fastest that it closes or opens near its smallest, m/s), `viscosity` (kinematic,
    /// m²/s), `film_reynolds` (h |ḣ|/ν), `viscous_over_inertial` (24 over that), `stokes` (inertia of the bodies over the viscous force, None where there is no
    /// film) and `lubricated`. None where there is no gap, no water, and where surfaces overlap.
    fn gap_flow<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let inner = self.inner.clone();
        let Some(flow) = long(py, move |_| inner.gap_flow())? else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        out.set_item("time", flow.time)?;
        out.set_item("gap", flow.gap)?;
        out.set_item("bodies", flow.bodies)?;
        out.set_item("speed", flow.speed)?;
        out.set_item("viscosity", flow.viscosity)?;
        out.set_item("film_reynolds", flow.film_reynolds)?;
        out.set_item("viscous_over_inertial", flow.viscous_over_inertial)?;
        out.set_item("stokes", flow.stokes)?;
        out.set_item("lubricated", flow.lubricated)?;
        Ok(Some(out))
    }
}
