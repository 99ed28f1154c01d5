//! Optimal control: iLQR, the feedback about a plan, and model-predictive control.

use crate::array::{self, Dim, array};
use crate::cost::CostTerm;
use crate::error::{counts, input, shown};
use crate::interrupt::{Told, long};
use crate::optimize::class;
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use crate::state::State;
use crate::tracking::Tracking;
use hydrograd::dynamics;
use hydrograd::optimize::{self, Cost, Guess, IlqrProgress, IlqrSettings, IlqrStop, Plan, Problem};
use nalgebra::DMatrix;
use pyo3::prelude::*;
use pyo3::types::PyDict;

pub fn stopped(stop: IlqrStop) -> String {
    let stop = serde_json::to_value(stop).unwrap_or_default();
    stop.as_str().unwrap_or_default().to_string()
}

/// A sum of terms.
pub fn summed(terms: Vec<PyRef<'_, CostTerm>>) -> Cost {
    let add = |cost: Cost, term: PyRef<'_, CostTerm>| match term.last {
        true => cost.last(term.term.clone()),
        false => cost.running(term.term.clone()),
    };
    terms.into_iter().fold(Cost::default(), add)
}

/// Limits of controls: none, one for all, or one each; infinite ones are allowed.
fn limits(place: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(given) = given else {
        return Ok(Vec::new());
    };
    let expected = "must be a number, or one for each control";
    let refuse = |_| input(place, shown(given), expected);
    match given.extract::<f64>() {
        Ok(all) => Ok(vec![all]),
        Err(_) => given.extract::<Vec<f64>>().map_err(refuse),
    }
}

/// What is to be found; errors call what is given `place`'s.
pub fn problem(
    place: &str,
    cost: Vec<PyRef<'_, CostTerm>>,
    knots: usize,
    hold: usize,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
    previous: Option<&Bound<'_, PyAny>>,
) -> PyResult<Problem> {
    let previous = previous.map(|given| array::row(&format!("{place}: previous"), given));
    Ok(Problem {
        knots,
        hold,
        cost: summed(cost),
        lower: limits("limits: lower", lower)?,
        upper: limits("limits: upper", upper)?,
        previous: previous.transpose()?,
    })
}

/// Where iLQR starts.
enum Start {
    Zero,
    Controls(DMatrix<f64>),
    Plan(optimize::Tracking, usize),
}

impl Start {
    fn of(
        given: Option<&Bound<'_, PyAny>>,
        shift: usize,
        (knots, controls): (usize, usize),
    ) -> PyResult<Self> {
        let unmoved = || match shift {
            0 => Ok(()),
            _ => Err(input(
                "ilqr: shift",
                shift,
                "must be 0 unless the guess is a plan, which is so many time steps on its way",
            )),
        };
        let Some(given) = given else {
            unmoved()?;
            return Ok(Self::Zero);
        };
        let tracking = match given.cast::<Tracking>() {
            Ok(_) => Some(given.clone()),
            Err(_) => given.getattr_opt("tracking")?,
        };
        if let Some(tracking) = tracking {
            let tracking = tracking.cast_into::<Tracking>()?;
            return Ok(Self::Plan(tracking.get().inner.clone(), shift));
        }
        unmoved()?;
        let shape = [Dim::Is(knots), Dim::Is(controls)];
        Ok(Self::Controls(
            array("ilqr: guess", given, &shape)?.columns(controls),
        ))
    }

    fn guess(&self) -> Guess<'_> {
        match self {
            Self::Zero => Guess::Zero,
            Self::Controls(matrix) => Guess::Controls(matrix),
            Self::Plan(plan, shift) => Guess::Plan {
                plan,
                shift: *shift,
            },
        }
    }
}

/// An iteration, as a callback is told of it.
fn iteration<'py>(py: Python<'py>, p: &IlqrProgress) -> PyResult<Bound<'py, PyAny>> {
    let parts = (
        p.iteration,
        p.cost,
        p.expected,
        p.part,
        p.regularisation,
        p.gradient,
    );
    class(py, "IlqrProgress")?.call1(parts)
}

/// The state that was given, or where the simulator starts.
pub fn start(
    given: Option<&Py<State>>,
    simulator: &hydrograd::Simulator,
) -> hydrograd::Result<dynamics::State> {
    given.map_or_else(|| simulator.initial(), |state| state.get().of(simulator))
}

fn planned<'py>(simulator: &Bound<'py, Simulator>, plan: Plan) -> PyResult<Bound<'py, PyAny>> {
    let py = simulator.py();
    let tracking = Tracking::new(simulator, plan.tracking());
    let seconds = PyDict::new(py);
    for (name, time) in [
        ("rollouts", plan.times.rollouts),
        ("derivatives", plan.times.derivatives),
        ("sweeps", plan.times.sweeps),
        ("total", plan.times.total),
    ] {
        seconds.set_item(name, time)?;
    }
    let costs = plan.costs.clone();
    let count = costs.len();
    let fields = PyDict::new(py);
    let nu = plan.controls.nrows();
    fields.set_item("controls", array::transposed(py, &plan.controls, &[nu])?)?;
    fields.set_item("gains", array::matrices(py, &plan.gains)?)?;
    fields.set_item("steps", array::columns(py, &plan.steps)?)?;
    fields.set_item("cost", plan.cost())?;
    fields.set_item("costs", array::to_python(py, costs, &[count])?)?;
    fields.set_item("gradient", plan.gradient)?;
    fields.set_item("regularisation", plan.regularisation)?;
    fields.set_item("iterations", plan.iterations)?;
    fields.set_item("stop", stopped(plan.stop))?;
    fields.set_item("seconds", seconds)?;
    fields.set_item("tracking", Bound::new(py, tracking)?)?;
    fields.set_item(
        "rollout",
        Bound::new(py, Rollout::new(simulator, plan.rollout))?,
    )?;
    class(py, "Plan")?.call((), Some(&fields))
}

/// Controls over a horizon that lower a cost from a state on, within limits, by iterated linear–quadratic regulation on the simulator's own Jacobians: a `Plan`, with the feedback about
/// it. `cost` is a list of terms (`hydrograd.cost`).
///
/// There are `knots` of controls, each held over `hold` time steps; `lower` and `upper` are the least and largest open-loop controls (N, N m), one for all or (control_size,); None: none. `previous`
/// (control_size,): the controls before the first knot, from which `cost.control_change` counts. It starts at the `state`, or where the simulator does, from `guess`: controls (knots, control_size), or
/// a `Plan` that was made before, of which `shift` time steps have passed, with its feedback; None: no control.
///
/// It makes `iterations` at most, and ends once one lowers the cost, or expects to, by less than `tolerance` of it, or the cost is at most `target`. `regularisation` is the part by which each control's
/// curvature is made larger at first, `trials` the most lengths of a step that are tried. `progress(p)` is called after every iteration with an `IlqrProgress`; where it gives True the plan so far is
/// what is found. What it raises ends it and comes out, and so does what a cost or a controller of your own raises. Ctrl-C ends it.
#[pyfunction]
#[pyo3(signature = (
    simulator, cost, *, knots, hold=1, lower=None, upper=None, previous=None, state=None, guess=None, shift=0, iterations=100, tolerance=1e-9, target=None, regularisation=0.0,
    trials=10, progress=None
))]
#[expect(clippy::too_many_arguments, reason = "one per keyword")]
pub fn ilqr<'py>(
    py: Python<'py>,
    simulator: &Bound<'py, Simulator>,
    cost: Vec<PyRef<'py, CostTerm>>,
    #[pyo3(from_py_with = counts::knots)] knots: usize,
    #[pyo3(from_py_with = counts::hold)] hold: usize,
    lower: Option<&Bound<'py, PyAny>>,
    upper: Option<&Bound<'py, PyAny>>,
    previous: Option<&Bound<'py, PyAny>>,
    state: Option<&Bound<'py, State>>,
    guess: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = counts::shift)] shift: usize,
    #[pyo3(from_py_with = counts::iterations)] iterations: usize,
    tolerance: f64,
    target: Option<f64>,
    regularisation: f64,
    #[pyo3(from_py_with = counts::trials)] trials: usize,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let me = simulator.get();
    let problem = problem("ilqr", cost, knots, hold, lower, upper, previous)?;
    let start = Start::of(guess, shift, (knots, me.controls_size()))?;
    let state = state.map(|state| state.clone().unbind());
    let settings = IlqrSettings {
        iterations,
        tolerance,
        target,
        regularisation,
        trials,
        ..IlqrSettings::default()
    };
    let (told, raised) = Told::new(progress);
    let inner = me.inner.clone();
    let made = long(py, move |interrupt| {
        let state = self::start(state.as_ref(), &inner)?;
        optimize::ilqr(&inner, &state, &problem, start.guess(), &settings, |p| {
            told.tell(interrupt, |py| iteration(py, p))
        })
    });
    planned(simulator, raised.or(made)?)
}

/// Adds the classes and the function to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<CostTerm>()?;
    m.add_class::<Tracking>()?;
    m.add_function(wrap_pyfunction!(crate::tracking::_tracking, m)?)?;
    m.add_function(wrap_pyfunction!(ilqr, m)?)
}
