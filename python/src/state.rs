//! One step at a time: states, and what a step leaves for its transpose.

use crate::array::{self, Dim};
use crate::gradient;
use crate::interrupt::short;
use crate::simulator::Simulator;
use crate::tangents::{self, Along};
use hydrograd::dynamics;
use nalgebra::{DMatrix, DVector};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::Arc;

/// A state between two steps: made by `Simulator.state`, `Simulator.step` or `Rollout.state`.
///
/// Other simulators of the same sizes take it as well, whatever their parameters, their integrator and their time step: `q`, `v` and the number of steps are kept.
#[pyclass(frozen, module = "hydrograd")]
pub struct State {
    /// The simulator that it belongs to.
    pub simulator: Py<Simulator>,
    /// The integrator's state.
    pub state: dynamics::State,
    /// Its generalised velocity.
    pub velocity: DVector<f64>,
}

type Parts = (
    Py<Simulator>,
    usize,
    Vec<f64>,
    Vec<f64>,
    Vec<bool>,
    usize,
    Vec<f64>,
);

impl State {
    fn poses(&self) -> Vec<hydrograd::adjoint::lie::Pose> {
        self.simulator
            .get()
            .inner
            .system()
            .tree
            .kinematics(&self.state.q)
            .poses
    }

    /// The same state for a simulator, which may be another: to the bit where both have the same scene, choices and parameters. Elsewhere what an integrator steps in (for
    /// most momentum) is another for the same motion: there it is made anew of coordinates and velocity.
    ///
    /// # Errors
    /// What `simulator` refuses of them.
    pub fn of(&self, simulator: &hydrograd::Simulator) -> hydrograd::Result<dynamics::State> {
        let (own, state) = (&*self.simulator.get().inner, &self.state);
        let tree = &simulator.system().tree;
        let fits = [state.q.len(), self.velocity.len()] == [tree.coordinates(), tree.velocities()];
        // Of other sizes it is refused where it is used.
        if !fits || is_alike(own, simulator) {
            return Ok(state.clone());
        }
        let made = simulator.state(state.step, &state.q, &self.velocity)?;
        let held = state.held.clone();
        let held = (held.len() == simulator.system().len()).then_some(held);
        Ok(dynamics::State {
            held: held.unwrap_or_default(),
            mode: state.mode,
            ..made
        })
    }

    /// From its parts, as `__reduce__` gives them.
    pub fn from_parts((simulator, step, q, y, held, mode, v): Parts) -> Self {
        Self {
            simulator,
            state: dynamics::State {
                step,
                q: q.into(),
                y: y.into(),
                held,
                mode,
            },
            velocity: v.into(),
        }
    }
}

/// Whether the numbers of states mean the same to both.
fn is_alike(a: &hydrograd::Simulator, b: &hydrograd::Simulator) -> bool {
    // Clones share their scene: big meshes aren't gone through then.
    let scenes = || std::ptr::eq(a.scene(), b.scene()) || a.scene() == b.scene();
    std::ptr::eq(a, b)
        || (a.choices() == b.choices() && a.parameters() == b.parameters() && scenes())
}

#[pymethods]
impl State {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    /// Number of steps made.
    #[getter]
    fn step(&self) -> usize {
        self.state.step
    }

    /// Time, s.
    #[getter]
    fn time(&self) -> f64 {
        self.simulator.get().inner.stepper().time(&self.state)
    }

    /// Joint coordinates, (q_size,).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array::to_python(py, self.state.q.as_slice().to_vec(), &[self.state.q.len()])
    }

    /// Generalised velocity, (v_size,).
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array::to_python(
            py,
            self.velocity.as_slice().to_vec(),
            &[self.velocity.len()],
        )
    }

    /// What the scene's controller remembers; 0 without one.
    #[getter]
    fn mode(&self) -> usize {
        self.state.mode
    }

    /// Bodies whose joints the scene's controller held in the step that led here, (bodies,).
    #[getter]
    fn held<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let mut held = self.state.held.clone();
        held.resize(self.simulator.get().inner.system().len(), false);
        PyArray1::from_vec(py, held)
    }

    /// Positions of the bodies' origins, (bodies, 3), m, world axes.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let poses = self.poses();
        let numbers = poses
            .iter()
            .flat_map(|p| p.translation.iter().copied().collect::<Vec<_>>());
        array::to_python(py, numbers.collect(), &[poses.len(), 3])
    }

    /// Rotation matrices of the bodies, body to world, (bodies, 3, 3).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let poses = self.poses();
        let numbers = poses
            .iter()
            .flat_map(|p| p.rotation.transpose().as_slice().to_vec());
        array::to_python(py, numbers.collect(), &[poses.len(), 3, 3])
    }

    fn __repr__(&self) -> String {
        format!("State(step={}, time={:?} s)", self.state.step, self.time())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_state")?;
        let s = &self.state;
        let list = |x: &DVector<f64>| x.as_slice().to_vec();
        let simulator = self.simulator.clone_ref(py);
        Ok((
            make,
            (
                simulator,
                s.step,
                list(&s.q),
                list(&s.y),
                s.held.clone(),
                s.mode,
                list(&self.velocity),
            ),
        ))
    }
}

/// What one step leaves behind: the key to its derivatives.
#[pyclass(frozen, module = "hydrograd")]
pub struct Record(pub Arc<hydrograd::simulate::Record>, pub Py<Simulator>);

#[pymethods]
impl Record {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.1)
    }

    /// Transpose of the step: derivatives of `q·δq + v·δv + positions·δx + rotations·δθ` of the state after it, with `q` (v_size,) in
    /// the tangent space of the coordinates, `v` (v_size,), and `positions` and `rotations` (δR = δθ × R, world axes) (bodies, 3);
    /// what is None is zero.
    #[pyo3(signature = (*, q=None, v=None, positions=None, rotations=None))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        q: Option<&Bound<'py, PyAny>>,
        v: Option<&Bound<'py, PyAny>>,
        positions: Option<&Bound<'py, PyAny>>,
        rotations: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut seed = self.0.zero_cotangents();
        let nv = [Dim::Is(seed.q.nrows())];
        let bodies = [Dim::Is(seed.positions.nrows() / 3), Dim::Is(3)];
        let parts: [(&str, _, &mut DMatrix<f64>, &[Dim]); 4] = [
            ("vjp: q", q, &mut seed.q, &nv),
            ("vjp: v", v, &mut seed.v, &nv),
            ("vjp: positions", positions, &mut seed.positions, &bodies),
            ("vjp: rotations", rotations, &mut seed.rotations, &bodies),
        ];
        for (place, given, part, shape) in parts {
            if let Some(given) = given {
                let found = array::array(place, given, shape)?;
                part.set_column(1, &DVector::from_vec(found.values));
            }
        }
        let made = short(py, || self.0.vjp(&seed))?;
        gradient::of_step(py, &made)
    }

    /// The linearisation x₁ ≈ A x₀ + B u of the step in x = (q, v), coordinates in their tangent space: A (2 v_size, 2 v_size)
    /// and B (2 v_size, control_size); with `parameters` also the derivatives with respect to those named (2 v_size, parameters).
    #[pyo3(signature = (parameters=None))]
    fn jacobians<'py>(
        &self,
        py: Python<'py>,
        parameters: Option<Vec<String>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let (record, names) = (self.0.clone(), parameters.clone().unwrap_or_default());
        let shapes = tangents::shapes(self.0.rollout(), names.len());
        let made = short(py, move || {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            record.rollout().jacobians_with(&names)
        })?;
        tangents::matrices(py, &[made], parameters.is_some(), false, shapes)
    }

    /// Tangent of the step: the changes (δq, δv) (v_size,) each of the state after it along `q` (v_size,) in the tangent space of the
    /// coordinates and `v` (v_size,) of the state before it, `u` (control_size,) of its controls, `parameters` by name, and `gains`; what is None
    /// is zero. Each may have one more index before its own, and so has the tangent then: many directions cost little more than one.
    #[pyo3(signature = (*, q=None, v=None, u=None, parameters=None, gains=None))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        q: Option<&Bound<'py, PyAny>>,
        v: Option<&Bound<'py, PyAny>>,
        u: Option<&Bound<'py, PyAny>>,
        parameters: Option<&Bound<'py, PyAny>>,
        gains: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let along = Along {
            controls: u,
            q,
            v,
            parameters,
            gains,
        };
        tangents::of_step(py, &self.0, &along)
    }

    fn __repr__(&self) -> String {
        let n = self.0.rollout().states()[0].step;
        format!("Record(step {n} to {})", n + 1)
    }
}
