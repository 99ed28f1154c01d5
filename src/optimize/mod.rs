//! Descent along gradients of rollouts.
//!
//! [`lbfgs`] is the comfortable way: open-loop controls of a simulator against an [`Objective`]. [`minimise`] is the open one:
//! anything that gives a value and its gradient, such as a rollout through [`crate::simulate::Knots`] or the gains of a
//! controller.
//!
//! The descent is L-BFGS with the line search of Moré and Thuente, from the crate `argmin`. A trial whose simulation fails
//! (bodies driven into one another, a step too long) doesn't end it: the search is turned back towards the best point so far.
//!
//! # References
//! J. Nocedal, "Updating Quasi-Newton Matrices with Limited Storage", 1980; J. Moré and D. Thuente, "Line Search Algorithms with
//! Guaranteed Sufficient Decrease", 1994.

mod descent;

pub use descent::minimise;

use crate::simulate::{Controls, Objective, Simulator};
use crate::{Error, Result};
use nalgebra::DMatrix;
use serde::Serialize;

/// When and how far to descend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Most iterations.
    pub iterations: usize,
    /// Most evaluations of value and gradient.
    pub evaluations: usize,
    /// Pairs of steps and gradient changes that are remembered.
    pub memory: usize,
    /// Length of the first trial step, in units of x.
    pub first_step: f64,
    /// Ends once the gradient is shorter than this part of the first one.
    pub gradient_tolerance: f64,
    /// Ends once the cost falls by less than this part of itself in an iteration.
    pub cost_tolerance: f64,
    /// Ends once the cost is no larger.
    pub target: Option<f64>,
    /// Longest gradient, in multiples of the first one: a longer one is shortened to it, its direction kept. Where a trajectory
    /// is about to jump (a contact that is just missed), gradients are huge and say little.
    pub clip: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            iterations: 100,
            evaluations: 1000,
            memory: 10,
            first_step: 0.1,
            gradient_tolerance: 1e-6,
            cost_tolerance: 1e-9,
            target: None,
            clip: None,
        }
    }
}

/// State of a descent after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations made.
    pub iteration: usize,
    /// Cost.
    pub cost: f64,
    /// Length of the gradient, after [`Settings::clip`].
    pub gradient: f64,
    /// Values and gradients evaluated.
    pub evaluations: usize,
}

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The cost reached [`Settings::target`].
    Target,
    /// The gradient fell below [`Settings::gradient_tolerance`].
    Gradient,
    /// The cost fell by less than [`Settings::cost_tolerance`], or no trial along the direction made it fall.
    Cost,
    /// [`Settings::iterations`] or [`Settings::evaluations`] are used up.
    Budget,
}

/// Where a descent ended: the best point that it saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The point.
    pub x: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Length of its gradient, after [`Settings::clip`].
    pub gradient: f64,
    /// Iterations made.
    pub iterations: usize,
    /// Values with gradients evaluated, those that failed included.
    pub evaluations: usize,
    /// Trials whose evaluation failed.
    pub failures: usize,
    /// Why it ended.
    pub stop: Stop,
}

/// The best controls that [`lbfgs`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    /// The controls.
    pub controls: Controls,
    /// Their cost.
    pub cost: f64,
    /// Rollouts made, each with its gradient.
    pub rollouts: usize,
    /// Iterations made.
    pub iterations: usize,
    /// Why it ended.
    pub stop: Stop,
}

/// Open-loop controls that lower an objective, from `start`, with the default [`Settings`] but for the first step: a hundredth of
/// the controls that alone would balance the cost, as far as the gradient tells.
///
/// # Errors
/// The rollout of `start` fails, or the objective doesn't fit the scene.
pub fn lbfgs(simulator: &Simulator, start: Controls, objective: &dyn Objective) -> Result<Best> {
    let shape = start.matrix().shape();
    let of = |x: &[f64]| {
        Controls::from_matrix(simulator, DMatrix::from_column_slice(shape.0, shape.1, x))
    };
    let evaluate = |x: &[f64]| {
        let rollout = simulator.rollout(&of(x)?)?;
        let cost = rollout.value(objective)?;
        let gradient = rollout.gradient(objective)?.controls;
        Ok((cost, gradient.as_slice().to_vec()))
    };
    let x = start.matrix().as_slice();
    let begun = descent::begin(evaluate, x)?;
    let (cost, slope) = (begun.0, descent::norm(&begun.1));
    let reach = if slope > 0.0 { cost.abs() / slope } else { 1.0 };
    let settings = Settings {
        first_step: if reach > 0.0 { 0.01 * reach } else { 1.0 },
        ..Settings::default()
    };
    let found = descent::descend(evaluate, x, begun, &settings, |_| {})?;
    Ok(Best {
        controls: of(&found.x)?,
        cost: found.cost,
        rollouts: found.evaluations,
        iterations: found.iterations,
        stop: found.stop,
    })
}

impl Settings {
    /// Checks the values.
    fn validate(&self) -> Result<()> {
        let positive = [
            ("first_step", self.first_step),
            ("clip", self.clip.unwrap_or(1.0)),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::input(
                    format!("optimize settings: {name}"),
                    value,
                    "must be a positive number",
                ));
            }
        }
        let tolerances = [
            ("gradient_tolerance", self.gradient_tolerance),
            ("cost_tolerance", self.cost_tolerance),
        ];
        for (name, value) in tolerances {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::input(
                    format!("optimize settings: {name}"),
                    value,
                    "must be zero or a positive number",
                ));
            }
        }
        if let Some(target) = self.target.filter(|t| t.is_nan()) {
            return Err(Error::input(
                "optimize settings: target",
                target,
                "must be a number",
            ));
        }
        let counts = [
            ("iterations", self.iterations),
            ("evaluations", self.evaluations),
            ("memory", self.memory),
        ];
        for (name, value) in counts {
            if value == 0 {
                return Err(Error::input(
                    format!("optimize settings: {name}"),
                    value,
                    "must be at least 1",
                ));
            }
        }
        Ok(())
    }
}
