//! Model-predictive control.

use crate::array::{self, Dim, array};
use crate::control::{problem, start, stopped, summed};
use crate::cost::CostTerm;
use crate::error::{counts, internal};
use crate::interrupt::{Interrupt, Progress, followed, lock, long, short};
use crate::optimize::class;
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use crate::state::State;
use hydrograd::Error;
use hydrograd::optimize::{self, IlqrSettings, MpcSettings, Problem, Replan};
use nalgebra::DVector;
use numpy::PyArrayDyn;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::time::Duration;

/// Model-predictive control: a plan over `knots` of `hold` time steps of the simulator `model`, made again by `iterations` of iLQR every `every` of its time steps from where the plant is, from the plan
/// before, moved on; the first one by `first_iterations`. Between plans the plan's `feedback` acts, or its controls alone. Other keywords are those of `ilqr`.
///
/// The plant may be a robot, which asks for controls step by step (`control`), or a simulator (`run`): the model itself, or one of another fidelity, current, parameters or time step.
#[pyclass(frozen, module = "hydrograd.optimize")]
pub struct Mpc {
    planner: Arc<Planner>,
    problem: Problem,
    model: Mutex<Py<Simulator>>,
}

/// What plans, for one piece of work at a time. Its mutexes are locked without the interpreter's lock, but for `replans`, which nobody holds for longer than a copy takes.
struct Planner {
    inner: Mutex<optimize::Mpc>,
    /// The work that is at it, or was last.
    work: Mutex<Interrupt>,
    /// All plans so far: to be read while it plans.
    replans: Mutex<Vec<Replan>>,
}

impl Planner {
    /// Does work with the planner. Other work isn't waited for, for it may be what asks, by one of its callbacks; unless Ctrl-C has left it to itself: then it ends soon.
    fn work<T>(
        &self,
        what: &str,
        interrupt: &Interrupt,
        work: impl FnOnce(&mut optimize::Mpc) -> hydrograd::Result<T>,
    ) -> hydrograd::Result<T> {
        let mut inner = self.enter(what, interrupt)?;
        let made = work(&mut inner);
        self.keep(inner.replans());
        made
    }

    fn enter(
        &self,
        what: &str,
        interrupt: &Interrupt,
    ) -> hydrograd::Result<MutexGuard<'_, optimize::Mpc>> {
        loop {
            let free = match self.inner.try_lock() {
                Ok(free) => Some(free),
                Err(TryLockError::Poisoned(free)) => Some(free.into_inner()),
                Err(TryLockError::WouldBlock) => None,
            };
            if let Some(free) = free {
                *lock(&self.work) = interrupt.clone();
                return Ok(free);
            }
            if !lock(&self.work).is_left() || interrupt.is_within() {
                return Err(Error::Unsupported {
                    what: format!("Mpc.{what} during run or control of the same Mpc"),
                    why: "it plans for one at a time".into(),
                    instead: "call it before or after, or make a second Mpc".into(),
                });
            }
            if interrupt.is_left() {
                return Err(Error::Stopped {
                    what: format!("Mpc.{what}, before its turn"),
                });
            }
            std::thread::sleep(TURN);
        }
    }

    /// Keeps a plan more, unless it is the last.
    fn add(&self, plan: Option<&Replan>) {
        let mut kept = lock(&self.replans);
        if kept.last() != plan {
            kept.extend(plan.cloned());
        }
    }

    /// Keeps the plans for those who ask.
    fn keep(&self, plans: &[Replan]) {
        let mut kept = lock(&self.replans);
        if kept.len() != plans.len() || kept.last() != plans.last() {
            *kept = plans.to_vec();
        }
    }
}

/// How often it is looked whether work that was left to itself has ended.
const TURN: Duration = Duration::from_millis(1);

fn replanned<'py>(py: Python<'py>, each: &[Replan]) -> PyResult<Bound<'py, PyList>> {
    let class = class(py, "Replan")?;
    let one = |r: &Replan| {
        class.call1((
            r.time,
            r.iterations,
            r.cost,
            r.stop.map(stopped),
            r.seconds,
            r.failure.clone(),
        ))
    };
    PyList::new(py, each.iter().map(one).collect::<PyResult<Vec<_>>>()?)
}

#[pymethods]
impl Mpc {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        // Nobody holds it for longer than a clone takes, with the interpreter's lock.
        match self.model.try_lock() {
            Ok(model) => visit.call(&*model),
            Err(_) => Ok(()),
        }
    }

    #[new]
    #[pyo3(signature = (
        model, cost, *, knots, hold=1, lower=None, upper=None, previous=None, every=1, iterations=3, first_iterations=50, feedback=true, tolerance=1e-6, trials=10
    ))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn new(
        model: &Bound<'_, Simulator>,
        cost: Vec<PyRef<'_, CostTerm>>,
        #[pyo3(from_py_with = counts::knots)] knots: usize,
        #[pyo3(from_py_with = counts::hold)] hold: usize,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        previous: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = counts::every)] every: usize,
        #[pyo3(from_py_with = counts::iterations)] iterations: usize,
        #[pyo3(from_py_with = counts::first_iterations)] first_iterations: usize,
        feedback: bool,
        tolerance: f64,
        #[pyo3(from_py_with = counts::trials)] trials: usize,
    ) -> PyResult<Self> {
        let problem = problem("mpc", cost, knots, hold, lower, upper, previous)?;
        let base = MpcSettings::default();
        let settings = MpcSettings {
            every,
            iterations,
            first_iterations,
            feedback,
            ilqr: IlqrSettings {
                tolerance,
                trials,
                ..base.ilqr
            },
        };
        let theirs = &model.get().inner;
        let inner = short(model.py(), || {
            optimize::Mpc::new(theirs, &problem, settings)
        })?;
        let planner = Planner {
            inner: Mutex::new(inner),
            work: Mutex::default(),
            replans: Mutex::default(),
        };
        Ok(Self {
            planner: Arc::new(planner),
            problem,
            model: Mutex::new(model.clone().unbind()),
        })
    }

    /// The simulator that plans.
    #[getter]
    fn model(&self, py: Python<'_>) -> Py<Simulator> {
        lock(&self.model).clone_ref(py)
    }

    /// Plans with another simulator from now on: one that has learnt the current, say. It must have the sizes and the time step of the one before. Not during `run` or `control`.
    fn set_model(&self, py: Python<'_>, model: &Bound<'_, Simulator>) -> PyResult<()> {
        let (planner, problem) = (self.planner.clone(), self.problem.clone());
        let theirs = model.get().inner.clone();
        long(py, move |interrupt| {
            planner.work("set_model", interrupt, |mpc| {
                mpc.set_model(&theirs, &problem)
            })
        })?;
        let before = std::mem::replace(&mut *lock(&self.model), model.clone().unbind());
        // Its end may call Python: not while the mutex is held.
        drop(before);
        Ok(())
    }

    /// Forgets plans, so that the next call starts anew. Not during `run` or `control`.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        let planner = self.planner.clone();
        long(py, move |interrupt| {
            planner.work("reset", interrupt, |mpc| {
                mpc.reset();
                Ok(())
            })
        })
    }

    /// All plans so far, those of a run under way among them: a list of `Replan`.
    #[getter]
    fn replans<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let all = lock(&self.planner.replans).clone();
        replanned(py, &all)
    }

    /// The controls, (control_size,), at a time, s, from where the plant is: `q` (q_size,), `v` (v_size,). Plans again when that is due. Times must not go back; the first one starts the clock.
    fn control<'py>(
        &self,
        py: Python<'py>,
        time: f64,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let model = self.model(py);
        let system = model.get().inner.system();
        let sizes = [system.tree.coordinates(), system.tree.velocities()];
        let row = |name: &str, given: &Bound<'_, PyAny>, n: usize| -> PyResult<DVector<f64>> {
            let found = array(&format!("control: {name}"), given, &[Dim::Is(n)])?;
            Ok(found.values.into())
        };
        let (q, v) = (row("q", q, sizes[0])?, row("v", v, sizes[1])?);
        let planner = self.planner.clone();
        let made = long(py, move |interrupt| {
            planner.work("control", interrupt, |mpc| {
                mpc.control_with(time, &q, &v, &mut |_| interrupt.check())
            })
        })?;
        array::to_python(py, made.as_slice().to_vec(), &[made.len()])
    }

    /// Runs a simulated plant for `steps` of its time steps from `state`, or from where it starts: an `MpcRun`; on from the plans so far if all of them are of times before, or it starts where the last run ended. Its cost is that of `cost`, or of the terms that are planned with.
    /// `progress(done, total)` is called every so often with the steps of the plant; what it raises ends the run, and so does Ctrl-C.
    #[pyo3(signature = (plant, steps, *, state=None, cost=None, progress=None))]
    fn run<'py>(
        &self,
        plant: &Bound<'py, Simulator>,
        #[pyo3(from_py_with = counts::steps)] steps: usize,
        state: Option<&Bound<'py, State>>,
        cost: Option<Vec<PyRef<'py, CostTerm>>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = plant.py();
        let theirs = plant.get().inner.clone();
        let cost = cost.map_or_else(|| self.problem.cost.clone(), summed);
        let state = state.map(|state| state.clone().unbind());
        let mut progress = Progress::new("run: progress", progress, steps)?;
        let planner = self.planner.clone();
        let made = followed(py, &mut progress, move |interrupt| {
            let state = start(state.as_ref(), &theirs)?;
            let made = planner.work("run", interrupt, |mpc| {
                mpc.run(&theirs, &state, steps, &cost, |p| {
                    planner.add(p.last.as_ref());
                    interrupt.at(p.step)
                })
            })?;
            let _ = interrupt.at(steps);
            Ok(made)
        });
        if let Some(raised) = progress.and_then(|progress| progress.raised) {
            return Err(raised);
        }
        let made = made?;
        if made.rates.len() != steps {
            return Err(internal("a run of another length"));
        }
        let parts = (
            Bound::new(py, Rollout::new(plant, made.rollout))?,
            array::to_python(py, made.rates, &[steps])?,
            made.cost,
            replanned(py, &made.replans)?,
        );
        class(py, "MpcRun")?.call1(parts)
    }
}
