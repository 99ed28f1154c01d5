//! L-BFGS on a function that may fail.

use super::{OptimizeProgress, OptimizeSettings, Optimum, Stop};
use crate::{Error, Result};
use argmin::core::{CostFunction, Gradient, IterState, Problem, Solver, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::cell::RefCell;

type Vector = Vec<f64>;
type Search = MoreThuenteLineSearch<Vector, Vector, f64>;
type Iterate = IterState<Vector, Vector, (), (), (), f64>;
/// A value with its gradient. Known by its signature alone, so that the search is compiled once for all functions.
type Function<'a> = dyn FnMut(&[f64]) -> Result<(f64, Vector)> + 'a;

/// Sufficient decrease and curvature of the line search.
const WOLFE: (f64, f64) = (1e-4, 0.9);
/// Relative width at which a line search gives up.
const WIDTH: f64 = 1e-3;
/// Cost of a failed trial above the best one's, in multiples of it, and its growth with the square of the distance from there.
const WALL: f64 = 10.0;

/// Point, cost and gradient.
#[derive(Clone, Debug)]
struct Point {
    x: Vector,
    cost: f64,
    gradient: Vector,
}

/// The function with what was seen of it. Costs and gradients are handed to the search divided by `scale`, so that its first step has the
/// length that was asked for.
struct Seen<'a> {
    function: &'a mut Function<'a>,
    best: Point,
    last: Point,
    scale: f64,
    clip: f64,
    evaluations: usize,
    most: usize,
    failures: usize,
    /// That it is to end.
    stopped: Option<Error>,
}

impl Seen<'_> {
    /// Evaluates at `x`, unless that was the last point.
    fn at(&mut self, x: &[f64]) -> std::result::Result<&Point, argmin::core::Error> {
        if self.last.x != x {
            if self.evaluations >= self.most {
                return Err(argmin::core::Error::msg("no evaluations left"));
            }
            self.evaluations += 1;
            self.last = match checked((self.function)(x), x.len()) {
                Ok((cost, gradient)) => Point {
                    x: x.to_vec(),
                    cost,
                    gradient: clipped(gradient, self.clip),
                },
                Err(stop @ Error::Stopped { .. }) => {
                    self.stopped = Some(stop);
                    return Err(argmin::core::Error::msg("stopped"));
                }
                Err(_) => {
                    self.failures += 1;
                    self.wall(x)
                }
            };
            if self.last.cost < self.best.cost {
                self.best = self.last.clone();
            }
        }
        Ok(&self.last)
    }

    /// What stands in for a failed trial: a bowl around the best point, above its cost.
    fn wall(&self, x: &[f64]) -> Point {
        let best = &self.best;
        let away: Vector = x.iter().zip(&best.x).map(|(a, b)| a - b).collect();
        let distance = norm(&away).max(f64::MIN_POSITIVE);
        // As steep as the best point's gradient, at least.
        let height = (WALL * best.cost.abs()).max(norm(&best.gradient) * distance);
        Point {
            x: x.to_vec(),
            cost: best.cost + height,
            gradient: away
                .iter()
                .map(|a| 2.0 * height * a / (distance * distance))
                .collect(),
        }
    }
}

/// Shared with the search, which wants to own what it evaluates.
struct Shared<'a, 'f>(&'a RefCell<Seen<'f>>);

impl CostFunction for Shared<'_, '_> {
    type Param = Vector;
    type Output = f64;

    fn cost(&self, x: &Vector) -> std::result::Result<f64, argmin::core::Error> {
        let mut seen = self.0.borrow_mut();
        let scale = seen.scale;
        Ok(seen.at(x)?.cost / scale)
    }
}

impl Gradient for Shared<'_, '_> {
    type Param = Vector;
    type Gradient = Vector;

    fn gradient(&self, x: &Vector) -> std::result::Result<Vector, argmin::core::Error> {
        let mut seen = self.0.borrow_mut();
        let scale = seen.scale;
        let gradient = &seen.at(x)?.gradient;
        Ok(gradient.iter().map(|g| g / scale).collect())
    }
}

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// At most as long as `longest`.
fn clipped(mut gradient: Vector, longest: f64) -> Vector {
    let length = norm(&gradient);
    if length > longest {
        gradient.iter_mut().for_each(|g| *g *= longest / length);
    }
    gradient
}

/// Refuses what isn't a number, and gradients of another length than the point has.
pub(super) fn checked(result: Result<(f64, Vector)>, length: usize) -> Result<(f64, Vector)> {
    let (cost, gradient) = result?;
    if gradient.len() != length {
        return Err(Error::input(
            "gradient",
            format!("{} numbers", gradient.len()),
            format!("must be {length} numbers, as many as the point has"),
        ));
    }
    let bad = gradient.iter().chain([&cost]).find(|x| !x.is_finite());
    match bad.copied() {
        None => Ok((cost, gradient)),
        Some(bad) => Err(Error::input("cost or gradient", bad, "must be finite")),
    }
}

/// Lowers a function from `start`; `function` gives its value and its gradient, `progress` is called after every iteration.
///
/// # Errors
/// Settings out of range, no numbers in `start`, a gradient of another length there, and whatever the function reports at `start`; failures at later trials
/// turn the search back and are counted, but for [`Error::Stopped`], which ends it.
pub fn minimise(
    mut function: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>)>,
    start: &[f64],
    settings: &OptimizeSettings,
    mut progress: impl FnMut(&OptimizeProgress),
) -> Result<Optimum> {
    descend(&mut function, start, settings, &mut progress)
}

fn descend(
    function: &mut Function,
    start: &[f64],
    settings: &OptimizeSettings,
    progress: &mut dyn FnMut(&OptimizeProgress),
) -> Result<Optimum> {
    settings.validate()?;
    if start.is_empty() {
        return Err(Error::input(
            "start of the descent",
            "0 numbers",
            "must be at least 1 number",
        ));
    }
    let (cost, gradient) = checked(function(start), start.len())?;
    let first = norm(&gradient);
    let reach = 0.01 * (cost.abs() / first);
    let first_step = (settings.first_step)
        .or((reach > 0.0 && reach.is_finite()).then_some(reach))
        .unwrap_or(1.0);
    let clip = settings.clip.map_or(f64::INFINITY, |c| c * first);
    let point = Point {
        x: start.to_vec(),
        cost,
        gradient: clipped(gradient, clip),
    };
    let seen = RefCell::new(Seen {
        function,
        best: point.clone(),
        last: point,
        scale: 1.0,
        clip,
        evaluations: 1,
        most: settings.evaluations,
        failures: 0,
        stopped: None,
    });
    let mut iterations = 0;
    let mut restarted = false;
    let mut descent = Descent::new(&seen, first_step, settings.memory)?;
    let stop = loop {
        let before = seen.borrow().best.clone();
        if settings.target.is_some_and(|t| before.cost <= t) {
            break Stop::Target;
        }
        if norm(&before.gradient) <= settings.gradient_tolerance * first {
            break Stop::Gradient;
        }
        if iterations == settings.iterations || seen.borrow().evaluations >= settings.evaluations {
            break Stop::Budget;
        }
        let advanced = descent.advance();
        if let Some(stop) = seen.borrow_mut().stopped.take() {
            return Err(stop);
        }
        iterations += 1;
        let after = seen.borrow().best.clone();
        progress(&OptimizeProgress {
            iteration: iterations,
            cost: after.cost,
            gradient: norm(&after.gradient),
            evaluations: seen.borrow().evaluations,
        });
        let fell = before.cost - after.cost;
        if fell > settings.cost_tolerance * before.cost.abs() {
            restarted = false;
            if advanced && descent.is_at(&after.x) {
                continue;
            }
        } else if restarted {
            break Stop::Cost;
        } else {
            restarted = true;
        }
        // The search lost its way, or ended elsewhere than at the best point: again from there, along the gradient.
        descent = Descent::new(&seen, first_step, settings.memory)?;
    };
    let seen = seen.into_inner();
    Ok(Optimum {
        gradient: norm(&seen.best.gradient),
        cost: seen.best.cost,
        x: seen.best.x,
        iterations,
        evaluations: seen.evaluations,
        failures: seen.failures,
        stop,
    })
}

/// A search under way from the best point.
struct Descent<'a, 'f> {
    problem: Problem<Shared<'a, 'f>>,
    solver: LBFGS<Search, Vector, Vector, f64>,
    state: Option<Iterate>,
}

fn broken(error: &argmin::core::Error) -> Error {
    Error::Solver {
        what: "descent".into(),
        iterations: 0,
        residual: f64::NAN,
        tolerance: 0.0,
        remedy: error.to_string(),
    }
}

impl<'a, 'f> Descent<'a, 'f> {
    fn new(seen: &'a RefCell<Seen<'f>>, first_step: f64, memory: usize) -> Result<Self> {
        let search = Search::new()
            .with_c(WOLFE.0, WOLFE.1)
            .and_then(|s| s.with_width_tolerance(WIDTH))
            .map_err(|e| broken(&e))?;
        let best = {
            let mut seen = seen.borrow_mut();
            // A first step of the length asked for, from here as from the start.
            let slope = norm(&seen.best.gradient);
            if slope > 0.0 {
                seen.scale = slope / first_step;
            }
            seen.last = seen.best.clone();
            seen.best.clone()
        };
        let mut problem = Problem::new(Shared(seen));
        let mut solver = LBFGS::new(search, memory);
        let state = Iterate::new().param(best.x);
        let (state, _) = solver.init(&mut problem, state).map_err(|e| broken(&e))?;
        Ok(Self {
            problem,
            solver,
            state: Some(state),
        })
    }

    /// One iteration; whether it came to an end.
    fn advance(&mut self) -> bool {
        let Some(state) = self.state.take() else {
            return false;
        };
        match self.solver.next_iter(&mut self.problem, state) {
            Ok((mut state, _)) => {
                let ended = !state.terminated();
                state.increment_iter();
                self.state = Some(state);
                ended
            }
            Err(_) => false,
        }
    }

    fn is_at(&self, x: &[f64]) -> bool {
        let at = self.state.as_ref().and_then(|s| s.get_param());
        at.is_some_and(|at| at == x)
    }
}
