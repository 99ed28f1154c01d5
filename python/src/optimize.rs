//! Descents and the recipe for grasps.

use crate::array::{self, Dim, array};
use crate::error::{counts, input, own};
use crate::interrupt::{Interrupt, long};
use crate::nested::ask;
use crate::rollout::Rollout;
use crate::scene::Scene;
use crate::simulator::Simulator;
use hydrograd::optimize::{
    self, Finger, GraspSettings, GraspTask, OptimizeSettings, Optimum, Smoothing,
};
use hydrograd::simulate::OpenLoop;
use hydrograd::{Controls, Error};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};

/// A class of what descents come to.
pub fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("hydrograd._optimize")?.getattr(name)
}

fn vector<'py>(py: Python<'py>, x: Vec<f64>) -> PyResult<Bound<'py, PyAny>> {
    let n = x.len();
    Ok(array::to_python(py, x, &[n])?.into_any())
}

/// A function of Python that gives a cost and its gradient. An `Error` of hydrograd's is a failure of that point; any other exception ends what calls it.
#[derive(Clone)]
struct Function {
    object: Arc<Py<PyAny>>,
    place: &'static str,
    raised: Arc<Mutex<Option<PyErr>>>,
    interrupt: Interrupt,
}

impl Function {
    fn call(&self, stage: Option<f64>, x: &[f64]) -> hydrograd::Result<(f64, Vec<f64>)> {
        let stopped = || Error::Stopped {
            what: self.place.into(),
        };
        // Not held while Python runs: that may well wait for another sample of this function.
        let raised = || self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        if raised().is_some() || self.interrupt.check().is_break() {
            return Err(stopped());
        }
        ask(|py| {
            let error = match self.value(py, stage, x) {
                Ok(found) => return Ok(found),
                Err(error) => error,
            };
            if own(py, &error) {
                return Err(Error::Controller {
                    source: Box::new(error),
                });
            }
            raised().get_or_insert(error);
            Err(stopped())
        })
    }

    fn value(&self, py: Python<'_>, stage: Option<f64>, x: &[f64]) -> PyResult<(f64, Vec<f64>)> {
        let point = vector(py, x.to_vec())?;
        let object = self.object.bind(py);
        let given = match stage {
            Some(stage) => object.call1((stage, point))?,
            None => object.call1((point,))?,
        };
        let Ok((cost, gradient)) = given.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
            return Err(pyo3::exceptions::PyTypeError::new_err(format!(
                "{}: function gives a value of type {}; it must be a tuple (cost, gradient)",
                self.place,
                given.get_type().name()?
            )));
        };
        let place = format!("{}: gradient", self.place);
        let gradient = array(&place, &gradient, &[Dim::Is(x.len())])?;
        Ok((cost.extract()?, gradient.values))
    }
}

/// Runs what calls a function; the exception that ended it, if one did.
fn calling<T: Send + 'static>(
    py: Python<'_>,
    place: &'static str,
    function: &Bound<'_, PyAny>,
    work: impl FnOnce(&Function) -> hydrograd::Result<T> + Send + 'static,
) -> PyResult<T> {
    if !function.is_callable() {
        return Err(input(
            format!("{place}: function"),
            format!("a value of type {}", function.get_type().name()?),
            "must be callable, and give a cost and its gradient",
        ));
    }
    let raised = Arc::new(Mutex::new(None));
    let theirs = raised.clone();
    let object = Arc::new(function.clone().unbind());
    let made = long(py, move |interrupt| {
        work(&Function {
            object,
            place,
            raised: theirs,
            interrupt: interrupt.clone(),
        })
    });
    let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
    match (raised.take(), made) {
        (Some(raised), Err(_)) => Err(raised),
        (_, made) => made,
    }
}

fn found<'py>(py: Python<'py>, optimum: Optimum) -> PyResult<Bound<'py, PyAny>> {
    let stop = serde_json::to_value(optimum.stop).unwrap_or_default();
    let parts = (
        vector(py, optimum.x)?,
        optimum.cost,
        optimum.gradient,
        optimum.iterations,
        optimum.evaluations,
        optimum.failures,
        stop.as_str().unwrap_or_default().to_string(),
    );
    class(py, "Optimum")?.call1(parts)
}

/// A descent of a function of Python, from arrays of one dimension: all have the same keywords.
macro_rules! descent {
    ($(#[$doc:meta])* $name:ident($($given:ident),*), $run:expr) => {
        $(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = (
            function, $($given,)* *, iterations=100, evaluations=1000, memory=10, first_step=Some(0.1), gradient_tolerance=1e-6,
            cost_tolerance=1e-9, target=None, clip=None
        ))]
        #[expect(clippy::too_many_arguments, reason = "one per keyword")]
        fn $name<'py>(
            py: Python<'py>,
            function: &Bound<'py, PyAny>,
            $($given: &Bound<'py, PyAny>,)*
            #[pyo3(from_py_with = counts::iterations)] iterations: usize,
            #[pyo3(from_py_with = counts::evaluations)] evaluations: usize,
            #[pyo3(from_py_with = counts::memory)] memory: usize,
            first_step: Option<f64>,
            gradient_tolerance: f64,
            cost_tolerance: f64,
            target: Option<f64>,
            clip: Option<f64>,
        ) -> PyResult<Bound<'py, PyAny>> {
            $(let $given = array::row(concat!(stringify!($name), ": ", stringify!($given)), $given)?;)*
            let settings = OptimizeSettings {
                iterations,
                evaluations,
                memory,
                first_step,
                gradient_tolerance,
                cost_tolerance,
                target,
                clip,
            };
            let made = calling(py, stringify!($name), function, move |function| {
                let run = $run;
                run(function, $(&$given,)* &settings)
            })?;
            found(py, made)
        }
    };
}

descent! {
    /// Lowers a function from `start` (n,), by L-BFGS that takes failures and jumps: an `Optimum`. `function(x)` gives the cost and its gradient (n,). Where it
    /// raises an `hg.Error` (a rollout that fails) the search is turned back; any other exception ends it, and so does Ctrl-C.
    ///
    /// `iterations` and `evaluations` are the most that are made, `memory` the pairs that are remembered, `first_step` the length of the first trial
    /// step in units of x (None: from the cost and its gradient). It ends once the gradient is shorter than `gradient_tolerance` of the first one, the cost falls
    /// by less than `cost_tolerance` of itself, or the cost is at most `target`. With `clip` gradients longer than that many times the first are shortened to it: where a
    /// trajectory is about to jump they are huge and say little.
    minimise(start),
    |function: &Function, start: &[f64], settings: &OptimizeSettings| {
        optimize::minimise(|x| function.call(None, x), start, settings, |_| {})
    }
}

descent! {
    /// Descends `function(stage, x)`, as `minimise` does, for each of `stages` in turn, each from where the one before ended: softnesses of contact
    /// (`Simulator.with_soft_contact`), say, that end in 1. The `Optimum` is that of the last stage, with the iterations, evaluations and failures of all; a stage
    /// whose start fails is passed over, unless it is the last. Keywords are those of `minimise`, for each stage.
    continuation(stages, start),
    |function: &Function, stages: &[f64], start: &[f64], settings: &OptimizeSettings| {
        let of = |stage: f64, x: &[f64]| function.call(Some(stage), x);
        optimize::continuation(of, stages, start, settings, |_, _| {})
    }
}

/// A function's cost and gradient averaged over a neighbourhood of `x` (n,): a `Smoothed`. `function(x)` gives the cost and its gradient (n,), at
/// `directions` normal displacements of standard deviation `spread` and their opposites, the same ones (`seed`) at every x, so that
/// what is averaged can be descended. Where it raises an `hg.Error` the direction is left out; any other exception ends it, and so does Ctrl-C. It is called from
/// several threads: rollouts in it run side by side.
#[pyfunction]
#[pyo3(signature = (function, x, *, spread=0.05, directions=16, seed=1))]
fn smoothed<'py>(
    py: Python<'py>,
    function: &Bound<'py, PyAny>,
    x: &Bound<'py, PyAny>,
    spread: f64,
    #[pyo3(from_py_with = counts::directions)] directions: usize,
    #[pyo3(from_py_with = counts::seed)] seed: u64,
) -> PyResult<Bound<'py, PyAny>> {
    let x = array::row("smoothed: x", x)?;
    let smoothing = Smoothing {
        spread,
        directions,
        seed,
    };
    let made = calling(py, "smoothed", function, move |function| {
        optimize::smoothed(|x| function.call(None, x), &x, &smoothing)
    })?;
    let mixed = made.mixed();
    let parts = (
        made.cost,
        made.deviation,
        vector(py, mixed)?,
        vector(py, made.first.gradient)?,
        vector(py, made.first.variance)?,
        vector(py, made.zeroth.gradient)?,
        vector(py, made.zeroth.variance)?,
        made.failures,
    );
    class(py, "Smoothed")?.call1(parts)
}

/// The name of a body that is given by its name or number.
fn body(place: &str, given: &Bound<'_, PyAny>, names: &[String]) -> PyResult<String> {
    if let Ok(name) = given.extract::<String>() {
        return Ok(name);
    }
    let number = given.extract::<usize>().ok().and_then(|b| names.get(b));
    number.cloned().ok_or_else(|| {
        let expected = format!("must be one of {names:?}, or its number");
        input(place, given, expected)
    })
}

/// One number for each control, given as such or once for all.
fn each(place: &str, given: &Bound<'_, PyAny>, controls: usize) -> PyResult<Vec<f64>> {
    match given.extract::<f64>() {
        Ok(all) => Ok(vec![all; controls]),
        Err(_) => array::row(place, given),
    }
}

/// Finds controls with which a gripper catches an object and holds it to the end of the run: a `Grasp`. One recipe with one set of settings: evenly
/// spread pushes, descents from the best of them, CMA-ES where nothing is caught.
///
/// `simulator` may be a scene, which is then simulated as its defaults say; it needs contact, and runs open-loop, whatever its own controller. `object` is the body
/// that is to be held and `fingers` those that hold it, each with the point (3,) of it that should press, m, body frame; bodies are given by name or number.
/// `closing` (controls,) has the sign that closes the gripper, and what part of the limit does; 0: it doesn't. `limits` are the largest absolute
/// values of the controls, N or N m, one or (controls,). `hold`: for how long it must be held at the end, s.
///
/// `knots` of each control, `pushes` that are tried, `starts`: the best of them from which is descended, `evaluations` with gradients of each part of a descent,
/// `softness` of contact over which is descended, in turn, `target`: a cost that is good enough, `search`: simulations of CMA-ES, `seed` of it.
/// Ctrl-C ends it.
#[pyfunction]
#[pyo3(signature = (
    simulator, *, object, fingers, closing, limits, hold=0.5, knots=None, pushes=None, starts=None, evaluations=None, softness=None, target=None,
    search=None, seed=1
))]
#[expect(clippy::too_many_arguments, reason = "one per keyword")]
fn grasp<'py>(
    py: Python<'py>,
    simulator: &Bound<'py, PyAny>,
    object: &Bound<'py, PyAny>,
    fingers: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    closing: &Bound<'py, PyAny>,
    limits: &Bound<'py, PyAny>,
    hold: f64,
    #[pyo3(from_py_with = counts::optional::knots)] knots: Option<usize>,
    #[pyo3(from_py_with = counts::optional::pushes)] pushes: Option<usize>,
    #[pyo3(from_py_with = counts::optional::starts)] starts: Option<usize>,
    #[pyo3(from_py_with = counts::optional::evaluations)] evaluations: Option<usize>,
    softness: Option<Vec<f64>>,
    target: Option<f64>,
    #[pyo3(from_py_with = counts::optional::search)] search: Option<usize>,
    #[pyo3(from_py_with = counts::seed)] seed: u64,
) -> PyResult<Bound<'py, PyAny>> {
    let simulator = match simulator.cast::<Scene>() {
        Ok(scene) => &py.get_type::<Simulator>().call1((scene,))?,
        Err(_) => simulator,
    };
    let Ok(simulator) = simulator.cast::<Simulator>() else {
        return Err(input(
            "grasp: simulator",
            format!("a value of type {}", simulator.get_type().name()?),
            "must be a Simulator or a Scene",
        ));
    };
    let me = simulator.get();
    let (names, controls) = (me.inner.names(), me.controls_size());
    let finger = |(of, pad): (Bound<'py, PyAny>, Bound<'py, PyAny>)| {
        PyResult::Ok(Finger {
            body: body("grasp: finger", &of, &names)?,
            pad: array::fixed("grasp: point of a finger", &pad)?,
        })
    };
    let task = GraspTask {
        object: body("grasp: object", object, &names)?,
        fingers: fingers.into_iter().map(finger).collect::<PyResult<_>>()?,
        closing: array::row("grasp: closing", closing)?,
        limits: each("grasp: limits", limits, controls)?,
        hold,
    };
    let default = GraspSettings::default();
    let settings = GraspSettings {
        knots: knots.unwrap_or(default.knots),
        pushes: pushes.unwrap_or(default.pushes),
        starts: starts.unwrap_or(default.starts),
        evaluations: evaluations.unwrap_or(default.evaluations),
        softness: softness.unwrap_or(default.softness),
        target: target.unwrap_or(default.target),
        search: search.unwrap_or(default.search),
        seed,
    };
    // What the grasp is run with: the same without a controller.
    let mut open = me.changed(|inner| {
        inner.set_policy(Box::new(OpenLoop));
        Ok(())
    })?;
    open.policy = None;
    open.scene.controller = None;
    let open = Bound::new(py, open)?;
    let inner = open.get().inner.clone();
    let (made, rollout) = long(py, move |interrupt| {
        let made = optimize::grasp(&inner, &task, &settings, |_, _| interrupt.check())?;
        let controls = Controls::from_matrix(&inner, made.controls.matrix().clone())?;
        let rollout = inner.rollout_from(&inner.initial()?, &controls, |_| interrupt.check())?;
        Ok((made, rollout))
    })?;
    let stage = serde_json::to_value(made.stage).unwrap_or_default();
    let matrix = made.controls.matrix();
    let fields = PyDict::new(py);
    fields.set_item("caught", made.caught)?;
    fields.set_item("held_since", made.held_since)?;
    fields.set_item("cost", made.cost)?;
    fields.set_item("stage", stage.as_str())?;
    fields.set_item("controls", array::transposed(py, matrix, &[controls])?)?;
    fields.set_item("rollout", Bound::new(py, Rollout::new(&open, rollout))?)?;
    fields.set_item("pushes_caught", made.pushes_caught)?;
    fields.set_item("simulations", made.simulations)?;
    fields.set_item("gradients", made.gradients)?;
    fields.set_item("failures", made.failures)?;
    class(py, "Grasp")?.call((), Some(&fields))
}

/// Adds the functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(minimise, m)?)?;
    m.add_function(wrap_pyfunction!(continuation, m)?)?;
    m.add_function(wrap_pyfunction!(smoothed, m)?)?;
    m.add_function(wrap_pyfunction!(grasp, m)?)
}
