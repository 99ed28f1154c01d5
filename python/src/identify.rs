//! Parameters from recordings.

use crate::array::{self, Dim, array};
use crate::error::{OrRaise, counts, input, shown};
use crate::interrupt::{Told, long};
use crate::mapping;
use crate::nested::ask;
use crate::optimize::class;
use crate::simulator::Simulator;
use hydrograd::optimize::{self, IdentifyProgress, IdentifySettings, Loss, Recorded};
use hydrograd::simulate::observable::observable;
use hydrograd::{Controls, Error};
use nalgebra::{DMatrix, DVector};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A number to be found by `identify`: the parameter `name`, or several, `sets` = {parameter: factor}; `sets_start` = {coordinate: factor} sets coordinates of
/// the initial state by their labels ("arm.angle"), in every experiment. The search begins at `start` (default: the prior's mean, or the first experiment's
/// value) and stays `within` (least, largest); `prior` = (mean, deviation) is what was known beforehand. `positive` searches over the logarithm: the prior's deviation is then that of the logarithm.
#[pyclass(frozen, module = "hydrograd.optimize")]
#[derive(Clone)]
pub struct Unknown {
    inner: optimize::Unknown,
}

#[pymethods]
impl Unknown {
    #[new]
    #[pyo3(signature = (name, *, sets=None, sets_start=None, start=None, prior=None, within=None, positive=false))]
    fn new(
        name: &str,
        sets: Option<&Bound<'_, PyAny>>,
        sets_start: Option<&Bound<'_, PyAny>>,
        start: Option<f64>,
        prior: Option<(f64, f64)>,
        within: Option<(f64, f64)>,
        positive: bool,
    ) -> PyResult<Self> {
        let mut inner = optimize::Unknown::new(name);
        let factors = |field: &str, given| {
            let place = format!("unknown {name:?}: {field}");
            mapping::named::<f64>(&place, "a number", given)
        };
        for (parameter, factor) in factors("sets", sets)? {
            inner = inner.sets(parameter, factor);
        }
        for (coordinate, factor) in factors("sets_start", sets_start)? {
            inner = inner.sets_start(coordinate, factor);
        }
        if let Some(start) = start {
            inner = inner.start(start);
        }
        if let Some((mean, deviation)) = prior {
            inner = inner.prior(mean, deviation);
        }
        if let Some((least, largest)) = within {
            inner = inner.within(least, largest);
        }
        if positive {
            inner = inner.positive();
        }
        Ok(Self { inner })
    }

    /// The inertia of a body about its centre of mass, as six unknowns that make a physical one whatever they are: entries xx, yy, zz (by their logarithms), xy, xz, yz of the upper
    /// triangular root L (√kg m) of its second moments of mass, I = tr(L Lᵀ) 1 - L Lᵀ, by the names "BODY.inertia.root.xx" and so on.
    #[staticmethod]
    fn inertia(body: &str) -> Vec<Self> {
        let all = optimize::Unknown::inertia(body).into_iter();
        all.map(|inner| Self { inner }).collect()
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }
}

/// A recording for `identify`: a `simulator` that starts as it did, and what was done, `controls` (steps, control_size) or none for so many `steps`. With `start_within` = (q, v) the initial
/// state is unknown, and known beforehand to these deviations (m or rad, m/s or rad/s; 0: exactly). `saw` adds what was seen.
#[pyclass(frozen, module = "hydrograd.optimize")]
pub struct Experiment {
    inner: Mutex<optimize::Experiment>,
    /// Holds a controller written in Python, which `inner` only points at.
    simulator: Py<Simulator>,
    steps: usize,
}

#[pymethods]
impl Experiment {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    #[new]
    #[pyo3(signature = (name, simulator, *, steps=None, controls=None, start_within=None))]
    fn new(
        name: &str,
        simulator: &Bound<'_, Simulator>,
        #[pyo3(from_py_with = counts::optional::steps)] steps: Option<usize>,
        controls: Option<&Bound<'_, PyAny>>,
        start_within: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let me = simulator.get();
        let controls = match (controls, steps) {
            (Some(given), None) => {
                let n = me.controls_size();
                let shape = [Dim::Any("steps"), Dim::Is(n)];
                let matrix = array("experiment: controls", given, &shape)?.columns(n);
                Controls::from_matrix(&me.inner, matrix).or_raise()?
            }
            (None, steps) => Controls::zeros(&me.inner, steps.unwrap_or_else(|| me.inner.steps())),
            (Some(_), Some(_)) => {
                let remedy = "give one of the two: controls have a row for each step";
                return Err(input("experiment: steps", "beside controls", remedy));
            }
        };
        let steps = controls.steps();
        let mut inner = optimize::Experiment::new(name, (*me.inner).clone(), controls);
        if let Some((q, v)) = start_within {
            inner = inner.start_within(q, v);
        }
        Ok(Self {
            inner: Mutex::new(inner),
            simulator: simulator.clone().unbind(),
            steps,
        })
    }

    /// Adds what was seen of one `entry` of an `observable`, by its number or its label ("hull.pitch"): `values` at `states` (default: at all, the start among them), and the standard
    /// `deviation` of the noise. NaN says that nothing was seen.
    #[pyo3(signature = (observable, entry, values, *, deviation, states=None))]
    fn saw(
        &self,
        observable: &str,
        entry: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        deviation: f64,
        states: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        // What may call Python comes first: nothing is held while it runs.
        let values = floats(values)?;
        let simulator = self.lock().simulator().clone();
        let entry = entry_of(&simulator, observable, entry)?;
        let states = self.states(states)?;
        if states.len() != values.len() {
            return Err(input(
                "experiment: values",
                format!("{} of them", values.len()),
                format!("must be as many as states, {}", states.len()),
            ));
        }
        let seen = states.into_iter().zip(values).filter(|(_, x)| !x.is_nan());
        let (states, values) = seen.unzip();
        let mut inner = self.lock();
        *inner = inner.clone().saw(Recorded {
            observable: observable.into(),
            entry,
            states,
            values,
            deviation,
        });
        Ok(())
    }

    /// Adds residuals that are a function of whole `observables` at `states` (default: all), such as amplitudes, phases and mean speeds: `function` gets them as arrays
    /// (states, …) by name in a dict, and gives differences from what was measured over their deviations, (n,). It must be differentiable, and is differentiated by differences of its own
    /// along exact tangents of the observables, without a simulation.
    #[pyo3(signature = (observables, function, *, states=None))]
    fn saw_function(
        &self,
        observables: Vec<String>,
        function: &Bound<'_, PyAny>,
        states: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let simulator = self.lock().simulator().clone();
        let system = simulator.system();
        let shapes = observables.iter();
        let shapes = shapes.map(|name| Ok(observable(name).or_raise()?.shape(system)));
        let shapes = shapes.collect::<PyResult<Vec<Vec<usize>>>>()?;
        let states = self.states(states)?;
        let function = function.clone().unbind();
        let names = observables.clone();
        let call = move |seen: &[DMatrix<f64>]| {
            ask(|py| -> PyResult<Vec<f64>> {
                let given = PyDict::new(py);
                for ((name, shape), values) in names.iter().zip(&shapes).zip(seen) {
                    let dims = [&[values.ncols()], &shape[..]].concat();
                    let values = values.as_slice().to_vec();
                    given.set_item(name, array::to_python(py, values, &dims)?)?;
                }
                floats(&function.bind(py).call1((given,))?)
            })
            .map(DVector::from_vec)
            .map_err(|raised| Error::Controller {
                source: Box::new(raised),
            })
        };
        let names: Vec<&str> = observables.iter().map(String::as_str).collect();
        let mut inner = self.lock();
        *inner = inner.clone().saw_function(&names, states, call);
        Ok(())
    }

    /// Makes a parameter `factor` times what an unknown sets it to, in this experiment: where a law says how it depends on what was done.
    fn scaled(&self, parameter: &str, factor: f64) {
        let mut inner = self.lock();
        *inner = inner.clone().scaled(parameter, factor);
    }

    /// Its name.
    #[getter]
    fn name(&self) -> String {
        self.lock().name().into()
    }
}

impl Experiment {
    fn lock(&self) -> MutexGuard<'_, optimize::Experiment> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Numbers of states; all where none are given.
    fn states(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<usize>> {
        let Some(given) = given else {
            return Ok((0..=self.steps).collect());
        };
        given.extract().map_err(|_| {
            input(
                "experiment: states",
                shown(given),
                "must be whole numbers from 0",
            )
        })
    }
}

/// Numbers, NaN among them.
fn floats(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let numpy = values.py().import("numpy")?;
    let flat = numpy
        .call_method1("asarray", (values, "float64"))?
        .call_method0("ravel")?;
    flat.call_method0("tolist")?.extract()
}

/// An entry by its number or its label.
fn entry_of(
    simulator: &hydrograd::Simulator,
    name: &str,
    entry: &Bound<'_, PyAny>,
) -> PyResult<usize> {
    let named = observable(name).or_raise()?;
    if let Ok(number) = entry.extract::<usize>() {
        return Ok(number);
    }
    let Ok(label) = entry.extract::<String>() else {
        return Err(input(
            format!("experiment: entry of {name:?}"),
            entry.repr()?.to_string(),
            "must be a number from 0, or a label",
        ));
    };
    let labels = named.labels(simulator.scene());
    labels.iter().position(|l| *l == label).ok_or_else(|| {
        input(
            format!("experiment: entry of {name:?}"),
            format!("{label:?}"),
            format!("must be a number or one of {labels:?}"),
        )
    })
}

fn loss(given: Option<(String, f64)>) -> PyResult<Loss> {
    match given {
        None => Ok(Loss::Squared),
        Some((name, k)) if name == "huber" => Ok(Loss::Huber(k)),
        Some((name, k)) if name == "cauchy" => Ok(Loss::Cauchy(k)),
        Some((name, _)) => Err(input(
            "identify: loss",
            format!("{name:?}"),
            "must be None, (\"huber\", k) or (\"cauchy\", k)",
        )),
    }
}

/// The unknowns that fit the recordings best, by Levenberg and Marquardt on exact Jacobians of rollouts, and how well they are known: an `Identified`.
///
/// `loss`: ("huber", k) or ("cauchy", k) forgives what lies more than k deviations off. It makes `iterations` at most, and ends once one lowers the misfit by less than
/// `cost_tolerance` of itself, or moves no unknown by more than `step_tolerance` standard errors; `damping` is that of the first. Of the `profiles` directions that are known least the
/// misfit is simulated. `progress(p)` is called after every iteration with an `IdentifyProgress`; where it gives True the best so far is what is found. Ctrl-C ends it.
#[pyfunction]
#[pyo3(signature = (
    experiments, unknowns, *, loss=None, iterations=50, damping=1e-6, cost_tolerance=1e-8, step_tolerance=1e-3, profiles=1, progress=None
))]
#[expect(clippy::too_many_arguments, reason = "one per keyword")]
fn identify<'py>(
    py: Python<'py>,
    experiments: Vec<PyRef<'py, Experiment>>,
    unknowns: Vec<PyRef<'py, Unknown>>,
    loss: Option<(String, f64)>,
    #[pyo3(from_py_with = counts::iterations)] iterations: usize,
    damping: f64,
    cost_tolerance: f64,
    step_tolerance: f64,
    #[pyo3(from_py_with = counts::profiles)] profiles: usize,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let settings = IdentifySettings {
        iterations,
        loss: self::loss(loss)?,
        damping,
        cost_tolerance,
        step_tolerance,
        profiles,
    };
    let experiments: Vec<optimize::Experiment> =
        (experiments.iter()).map(|e| e.lock().clone()).collect();
    let unknowns: Vec<_> = unknowns.iter().map(|u| u.inner.clone()).collect();
    let (told, raised) = Told::new(progress);
    let made = long(py, move |interrupt| {
        let tell = |p: &IdentifyProgress| {
            let parts = (p.iteration, p.cost, p.taken, p.step, p.simulations);
            told.tell(interrupt, |py| class(py, "IdentifyProgress")?.call1(parts))
        };
        let found = optimize::identify(&experiments, &unknowns, &settings, tell)?;
        serde_json::to_string(&found).map_err(|e| Error::input("identify", e, "must be numbers"))
    });
    class(py, "_identified")?.call1((raised.or(made)?,))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Unknown>()?;
    m.add_class::<Experiment>()?;
    m.add_function(wrap_pyfunction!(identify, m)?)
}
