//! Rollouts: trajectories with the key to their gradients.

use crate::array::{self, Dim};
use crate::contact;
use crate::error::{counts, in_order, input};
use crate::flow;
use crate::gradient;
use crate::interrupt::{Progress, ended, followed, light, long, short};
use crate::loads::Loads;
use crate::mapping;
use crate::objective::Objective;
use crate::output;
use crate::pressure::SurfacePressure;
use crate::simulator::Simulator;
use crate::state::State;
use crate::tangents::{self, Along};
use hydrograd::simulate::{
    Cotangents, GapReport, NearGap, Recording, Sample, Variables, observable,
};
use nalgebra::DMatrix;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A trajectory of states 0 … N: the forward pass, and the only key to its gradient. Each access to an array makes a new one.
#[pyclass(frozen, module = "hydrograd")]
pub struct Rollout {
    simulator: Py<Simulator>,
    inner: Arc<hydrograd::Rollout>,
}

type Numbers<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;

impl Rollout {
    /// What it shows.
    pub fn shared(&self) -> Arc<hydrograd::Rollout> {
        self.inner.clone()
    }

    /// A rollout of a simulator.
    pub fn new(simulator: &Bound<'_, Simulator>, inner: hydrograd::Rollout) -> Self {
        Self {
            simulator: simulator.clone().unbind(),
            inner: Arc::new(inner),
        }
    }

    fn numbers<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Sample) -> Vec<f64>,
        shape: &[usize],
    ) -> Numbers<'py> {
        let samples = self.inner.samples();
        let mut whole = vec![samples.len()];
        whole.extend(shape);
        array::to_python(py, samples.iter().flat_map(of).collect(), &whole)
    }

    fn bodies(&self) -> usize {
        self.inner.simulator().system().len()
    }
}

#[pymethods]
impl Rollout {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    /// The simulator that made it.
    #[getter]
    fn simulator(&self, py: Python<'_>) -> Py<Simulator> {
        self.simulator.clone_ref(py)
    }

    /// Number of steps N.
    #[getter]
    fn steps(&self) -> usize {
        self.inner.steps()
    }

    /// Time, (N + 1,), s.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.time], &[])
    }

    /// Joint coordinates, (N + 1, q_size), m, rad and unit quaternions (w, x, y, z).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let n = self.inner.simulator().system().tree.coordinates();
        self.numbers(py, |s| s.q.as_slice().to_vec(), &[n])
    }

    /// Generalised velocities, (N + 1, v_size), m/s and rad/s.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let n = self.inner.simulator().system().tree.velocities();
        self.numbers(py, |s| s.v.as_slice().to_vec(), &[n])
    }

    /// The open-loop controls, (N, control_size), N and N m.
    #[getter]
    fn controls<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let controls = self.inner.controls();
        array::transposed(py, controls, &[controls.nrows()])
    }

    /// The controls that acted, those of the scene's or your own controller included, (N, control_size), N and N m.
    #[getter]
    fn applied_controls<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let controls = self.inner.applied_controls();
        array::transposed(py, &controls, &[controls.nrows()])
    }

    /// Positions of the bodies' origins, (N + 1, bodies, 3), m, world axes.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let of = |s: &Sample| {
            s.poses
                .iter()
                .flat_map(|p| [p.translation.x, p.translation.y, p.translation.z])
                .collect()
        };
        self.numbers(py, of, &[self.bodies(), 3])
    }

    /// Rotation matrices of the bodies, body to world, (N + 1, bodies, 3, 3).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let of = |s: &Sample| {
            s.poses
                .iter()
                .flat_map(|p| p.rotation.transpose().as_slice().to_vec())
                .collect()
        };
        self.numbers(py, of, &[self.bodies(), 3, 3])
    }

    /// Velocities of the bodies, (N + 1, bodies, 6), world axes: of the origin, m/s, and angular, rad/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let made = light(py, || Ok(self.inner.velocities()))?;
        array::transposed(py, &made, &[self.bodies(), 6])
    }

    /// Kinetic energy of bodies and fluid, (N + 1,), J.
    #[getter]
    fn kinetic_energy<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.kinetic_energy], &[])
    }

    /// Potential energy of weight, buoyancy, springs, joints and tendons (those at the control 0), (N + 1,), J.
    #[getter]
    fn potential_energy<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| vec![s.potential_energy], &[])
    }

    /// Total momentum of bodies and fluid, (N + 1, 6): linear, kg m/s, then angular about the world's origin, kg m²/s.
    #[getter]
    fn momentum<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |s| s.momentum.as_slice().to_vec(), &[6])
    }

    /// Smallest gap between bodies or to a wall, (N + 1,), m; NaN where there is nothing to meet.
    #[getter]
    fn min_gap<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let gaps = short(py, || Ok(self.inner.gaps()))?;
        let distances: Vec<f64> = gaps
            .iter()
            .map(|g| g.map_or(f64::NAN, |g| g.distance))
            .collect();
        let n = distances.len();
        array::to_python(py, distances, &[n])
    }

    /// What should be known about this trajectory, with names and numbers.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        short(py, || Ok(self.inner.warnings()))
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

    /// The state after `step` steps, from which a run may go on; negative numbers count from the end.
    #[pyo3(signature = (step=-1), text_signature = "($self, step=-1)")]
    fn state(&self, py: Python<'_>, step: isize) -> PyResult<State> {
        let at = array::numbered(step, self.inner.states().len(), "state")?;
        Ok(State {
            simulator: self.simulator.clone_ref(py),
            state: self.inner.states()[at].clone(),
            velocity: self.inner.samples()[at].v.clone(),
        })
    }

    /// Contacts during the step from state `step` to the next, at the pose of that state: where surfaces are no more than `slack` (m)
    /// farther apart than the gap at which they touch, and what presses there. None where the scene has no contact. Negative
    /// numbers count from the end: -1 is the last step.
    #[pyo3(signature = (step, slack=0.0))]
    fn contacts<'py>(
        &self,
        py: Python<'py>,
        step: isize,
        slack: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        if !(slack.is_finite() && slack >= 0.0) {
            return Err(input(
                "contacts: slack",
                slack,
                "must be finite and not negative, in m",
            ));
        }
        let at = array::numbered(step, self.steps(), "step")?;
        let found = short(py, || self.inner.contacts(at, slack))?;
        contact::of_step(py, &found)
    }

    /// What acts on every body and across every joint at state `state`, as the step there starts: gravity, buoyancy, drag, thrust, the inertia of the water, contact. Negative
    /// numbers count from the end.
    ///
    /// At the last state (-1) no step begins: no control acts, nothing touches and no joint's stop presses, so that what lay or was held accelerates there. What presses at the end
    /// of a run is that of state -2.
    fn loads(&self, py: Python<'_>, state: isize) -> PyResult<Loads> {
        let at = array::numbered(state, self.inner.states().len(), "state")?;
        short(py, || self.inner.loads(at)).map(Loads)
    }

    /// The water's pressure on the surface of every body in it at state `state`, as the step there starts: one a body. It takes solves of its own. Negative numbers count
    /// states from the end. At the last state (-1) no step begins, as of `loads`: the water answers accelerations without controls and contact.
    fn pressure(&self, py: Python<'_>, state: isize) -> PyResult<Vec<SurfacePressure>> {
        let at = array::numbered(state, self.inner.states().len(), "state")?;
        let inner = self.inner.clone();
        let made = long(py, move |_| inner.pressure(at))?;
        Ok(made.into_iter().map(SurfacePressure).collect())
    }

    /// What an inertial measurement unit at the site of this name reads at every state (n, 6): acceleration less gravity (m/s²) and rates (rad/s), in the site's axes. At the last state no step begins: no control acts, and nothing touches.
    fn imu<'py>(&self, py: Python<'py>, site: &str) -> Numbers<'py> {
        let n = self.inner.states().len();
        let (inner, site) = (self.inner.clone(), site.to_string());
        let read = long(py, move |_| {
            in_order((0..n).into_par_iter().map(|k| inner.imu(&site, k)))
        })?;
        let values = read.iter().flat_map(|r| [r.specific_force, r.rates]);
        let values = values.flat_map(|x| [x.x, x.y, x.z]).collect();
        array::to_python(py, values, &[n, 6])
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

    /// An observable at the states 0 … N by its name, (N + 1, …): "positions", "energy", "momentum", …; an unknown name's error has the list.
    fn observe<'py>(&self, py: Python<'py>, name: &str) -> Numbers<'py> {
        let made = short(py, || {
            let found = observable::observable(name)?;
            Ok((found, self.inner.observe(name)?))
        })?;
        let shape = made.0.shape(self.inner.simulator().system());
        array::transposed(py, &made.1, &shape)
    }

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

    /// Columns by name, one row a state: time, each coordinate and velocity, energy, momentum and smallest gap, SI units, with `pressure` also that of the flow on every face
    /// ("ball.pressure_0", …, Pa), at the price of solves of its own a state; `pandas.DataFrame(rollout.to_dict())` is a table.
    #[pyo3(signature = (*, pressure=false))]
    fn to_dict<'py>(&self, py: Python<'py>, pressure: bool) -> PyResult<Bound<'py, PyDict>> {
        let (simulator, inner) = (self.simulator.clone_ref(py), self.inner.clone());
        let recording = long(py, move |_| {
            let mut recording = Recording::of(&simulator.get().scene, &inner)?;
            if pressure {
                recording.observables.push(inner.pressures()?);
            }
            Ok(recording)
        })?;
        let out = PyDict::new(py);
        let n = recording.time.len();
        let column = |values: Vec<f64>| array::to_python(py, values, &[n]);
        out.set_item("time", column(recording.time.clone())?)?;
        for (name, recorded, i) in recording.columns() {
            let values = recorded.values.iter().map(|row| row[i]).collect();
            out.set_item(name, column(values)?)?;
        }
        Ok(out)
    }

    /// Writes files of VTK, which ParaView opens, into a folder, which is made where there is none; the files to open are given. `bodies.pvd`: all bodies' triangles frame by frame, in the
    /// world, with the `body` (number) and the `velocity` (m/s) of every face, and with `pressure`, at the price of solves of its own a frame, the `pressure` of the flow and the `hydrostatic`
    /// one (Pa) and the `water_velocity` (m/s) there, as `pressure` tells them, zero where a face isn't `wetted` (1 or 0); `walls.vtp`: walls as squares; with `loads`, `loads.pvd`: at each body's origin what acts on it,
    /// `gravity_force` (N), `gravity_moment` (N m), `water_force`, …, of every kind that `loads` tells; with `flow`, two corners (3,) of a box and the spacing of a grid in it, m, `flow.pvd`: the
    /// water's `velocity` there, zero where it isn't `resolved`; with `streamlines`, seeds (n, 3) and a length, m, `streamlines.pvd`: the lines of `streamlines`, of seeds where the flow is known. Frames are up to `frames_per_second` of simulated time (30 unless told otherwise), or every `every`-th
    /// state, with the first and the last. Files of the same names are replaced. Ctrl-C ends it.
    #[pyo3(signature = (folder, *, frames_per_second=None, every=None, loads=false, pressure=false, flow=None, streamlines=None))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn write_vtk(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        frames_per_second: Option<f64>,
        every: Option<isize>,
        loads: bool,
        pressure: bool,
        flow: Option<output::GridBox<'_>>,
        streamlines: Option<output::Drawn<'_>>,
    ) -> PyResult<Vec<PathBuf>> {
        let frames = (frames_per_second, every);
        let more = (loads, pressure);
        output::write_vtk(py, &self.inner, folder, frames, more, flow, streamlines)
    }

    /// Writes an animated scene in glTF 2.0, to a name that ends in `.glb`, which Blender and browsers open, and gives its path: a node each body, moved between frames, and walls. Lengths are m and times s, counted from
    /// the first state; the node `hydrograd` above all turns z up. `colors` are "#rrggbb" by the names of bodies; frames are those of `write_vtk`. A file that stands there is replaced.
    #[pyo3(signature = (path, *, frames_per_second=None, every=None, colors=None))]
    fn write_gltf(
        &self,
        py: Python<'_>,
        path: PathBuf,
        frames_per_second: Option<f64>,
        every: Option<isize>,
        colors: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PathBuf> {
        let frames = (frames_per_second, every);
        let colors = mapping::named("write_gltf: colors", "a text, \"#rrggbb\"", colors)?;
        output::write_gltf(py, &self.inner, path, frames, colors)
    }

    /// Figures of the whole trajectory: energies (J), drift of momentum (relative), iterations, smallest gap (m), by what the water
    /// across gaps is carried and how far off it is estimated to be (`gaps`), the largest gap
    /// at which surfaces are taken to touch (m), steps that were cut into pieces, and the most pieces of one.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = short(py, || Ok(self.inner.summary()))?;
        let out = PyDict::new(py);
        out.set_item("steps", s.steps)?;
        out.set_item("energy_initial", s.energy_initial)?;
        out.set_item("energy_final", s.energy_final)?;
        out.set_item("energy_gain", s.energy_gain)?;
        out.set_item("energy_loss", s.energy_loss)?;
        out.set_item("momentum_drift", s.momentum_drift)?;
        out.set_item("momenta_kept", s.momenta_kept)?;
        out.set_item("iterations", s.iterations)?;
        out.set_item("asymmetry", s.asymmetry)?;
        out.set_item("min_gap", s.min_gap)?;
        out.set_item("gaps", gaps(py, &s.gaps)?)?;
        out.set_item("contact_gap", s.contact_gap)?;
        out.set_item("cut_steps", s.cut_steps)?;
        out.set_item("most_pieces", s.most_pieces)?;
        Ok(out)
    }

    fn __len__(&self) -> usize {
        self.inner.states().len()
    }

    fn __repr__(&self) -> String {
        format!(
            "Rollout(steps={}, bodies={:?})",
            self.steps(),
            self.inner.simulator().names()
        )
    }

    /// Run again where it is unpickled: its simulator, where it began, and the controls.
    #[expect(clippy::type_complexity, reason = "what pickle asks for")]
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (Py<Simulator>, State, Bound<'py, PyArrayDyn<f64>>),
    )> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_rollout")?;
        Ok((
            make,
            (
                self.simulator.clone_ref(py),
                self.state(py, 0)?,
                self.controls(py)?,
            ),
        ))
    }
}

/// What a summary says of gaps.
fn gaps<'py>(py: Python<'py>, report: &GapReport) -> PyResult<Bound<'py, PyDict>> {
    let near = |gap: &Option<NearGap>| -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(gap) = gap else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        out.set_item("time", gap.time)?;
        out.set_item("gap", gap.gap)?;
        out.set_item("bodies", gap.bodies.clone())?;
        out.set_item("carried", gap.carried.to_string())?;
        out.set_item("added_mass_error", gap.added_mass_error)?;
        out.set_item("force_error", gap.force_error)?;
        Ok(Some(out))
    };
    let out = PyDict::new(py);
    out.set_item("nearest", near(&report.nearest)?)?;
    out.set_item("worst", near(&report.worst)?)?;
    out.set_item("changes", report.changes)?;
    let changes = report.first_changes.iter();
    let changes = changes.map(|c| (c.time, c.bodies.clone(), c.carried.to_string()));
    out.set_item("first_changes", changes.collect::<Vec<_>>())?;
    Ok(out)
}
