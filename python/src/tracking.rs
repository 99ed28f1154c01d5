//! The feedback about a plan, as a policy, and as pickle has it.

use crate::array::{self, Dim, array};
use crate::error::OrRaise;
use crate::simulator::Simulator;
use hydrograd::optimize;
use hydrograd::simulate::{Action, Observation, Policy};
use nalgebra::{DMatrix, DVector};
use numpy::PyArrayDyn;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;

type Numbers<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The feedback that holds a robot to a plan, `u = ū + K (x ⊖ x̄)` within the plan's limits: a policy, for `Simulator.with_policy`. Before the plan starts and after it has ended
/// the nearest controls are held, without feedback.
#[pyclass(frozen, module = "hydrograd.optimize")]
pub struct Tracking {
    /// The Rust side's.
    pub inner: optimize::Tracking,
    /// What planned: it is prepared again where a pickle arrives.
    simulator: Py<Simulator>,
}

/// Simulator, start and hold, q and v at every time step, controls and gains of every knot, and limits.
type Parts<'py> = (
    Py<Simulator>,
    (f64, usize),
    (Numbers<'py>, Numbers<'py>),
    Numbers<'py>,
    Numbers<'py>,
    (Vec<f64>, Vec<f64>),
);

struct Seen {
    time: f64,
    q: DVector<f64>,
    v: DVector<f64>,
}

impl Seen {
    fn of(observation: &Bound<'_, PyAny>) -> PyResult<Self> {
        let row = |name: &str| -> PyResult<DVector<f64>> {
            let given = observation.getattr(name)?;
            Ok(array::row(&format!("tracking: {name}"), &given)?.into())
        };
        Ok(Self {
            time: observation.getattr("time")?.extract()?,
            q: row("q")?,
            v: row("v")?,
        })
    }

    fn observation(&self) -> Observation<'_> {
        Observation {
            step: 0,
            time: self.time,
            // A plan goes by the time alone.
            time_step: 0.0,
            q: &self.q,
            v: &self.v,
            mode: 0,
        }
    }
}

impl Tracking {
    /// About a plan of a simulator.
    pub fn new(simulator: &Bound<'_, Simulator>, inner: optimize::Tracking) -> Self {
        Self {
            inner,
            simulator: simulator.clone().unbind(),
        }
    }
}

#[pymethods]
impl Tracking {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let make = py.import("hydrograd._hydrograd")?.getattr("_tracking")?;
        let track = self.inner.track();
        let (q, v): (Vec<_>, Vec<_>) = track.states.iter().cloned().unzip();
        let limits = [&track.lower, &track.upper].map(|x| x.as_slice().to_vec());
        let parts = (
            self.simulator.clone_ref(py),
            (track.start, track.hold),
            (array::columns(py, &q)?, array::columns(py, &v)?),
            array::transposed(py, &track.controls, &[track.controls.nrows()])?,
            array::matrices(py, &track.gains)?,
            limits.into(),
        );
        Ok((make, parts))
    }

    /// The controls, (control_size,), at an observation: its `time`, `q` and `v`.
    fn act<'py>(&self, observation: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let seen = Seen::of(observation)?;
        let Action { control, .. } = self.inner.act(&seen.observation()).or_raise()?;
        let n = control.len();
        array::to_python(observation.py(), control, &[n])
    }

    /// Transpose of `act`: cotangents (q_bar, v_bar) from that of the controls.
    fn act_vjp<'py>(
        &self,
        observation: &Bound<'py, PyAny>,
        control_bar: &Bound<'py, PyAny>,
    ) -> PyResult<(Numbers<'py>, Numbers<'py>)> {
        let seen = Seen::of(observation)?;
        let bar = DVector::from_vec(array::row("tracking: control_bar", control_bar)?);
        let found = self.inner.act_vjp(&seen.observation(), &bar).or_raise()?;
        let n = seen.v.len();
        let full = |x: Vec<f64>| match x.is_empty() {
            true => array::to_python(observation.py(), vec![0.0; n], &[n]),
            false => array::to_python(observation.py(), x, &[n]),
        };
        Ok((full(found.q)?, full(found.v)?))
    }
}

/// Unpickles the feedback about a plan.
#[pyfunction]
pub fn _tracking<'py>(
    simulator: &Bound<'py, Simulator>,
    clock: (f64, usize),
    states: (Bound<'py, PyAny>, Bound<'py, PyAny>),
    controls: &Bound<'py, PyAny>,
    gains: &Bound<'py, PyAny>,
    limits: (Vec<f64>, Vec<f64>),
) -> PyResult<Tracking> {
    let planner = &simulator.get().inner;
    let (tree, nu) = (&planner.system().tree, planner.system().controls);
    let nx = 2 * tree.velocities();
    let rows = |name: &str, given: &Bound<'_, PyAny>, n: usize| -> PyResult<DMatrix<f64>> {
        let shape = [Dim::Any("n"), Dim::Is(n)];
        Ok(array(&format!("pickled tracking: {name}"), given, &shape)?.columns(n))
    };
    let q = rows("q", &states.0, tree.coordinates())?;
    let v = rows("v", &states.1, tree.velocities())?;
    let both = q.column_iter().zip(v.column_iter());
    let states = both
        .map(|(q, v)| (q.into_owned(), v.into_owned()))
        .collect();
    let shape = [Dim::Any("knots"), Dim::Is(nu), Dim::Is(nx)];
    let gains = array("pickled tracking: gains", gains, &shape)?.values;
    let gains = gains.chunks((nu * nx).max(1));
    let inner = optimize::Tracking::of(optimize::Track {
        simulator: hydrograd::Simulator::clone(planner),
        start: clock.0,
        hold: clock.1,
        states,
        controls: rows("controls", controls, nu)?,
        gains: gains.map(|k| DMatrix::from_row_slice(nu, nx, k)).collect(),
        lower: limits.0.into(),
        upper: limits.1.into(),
    });
    Ok(Tracking::new(simulator, inner.or_raise()?))
}
