//! Descent along gradients of rollouts.
//!
//! [`lbfgs`] is the comfortable way: open-loop controls of a simulator against an [`Objective`]. [`minimise`] is the open one:
//! anything that gives a value and its gradient, such as a rollout through [`crate::simulate::Knots`] or the gains of a
//! controller.
//!
//! The descent is L-BFGS with the line search of Moré and Thuente, from the crate `argmin`. A trial whose simulation fails
//! (bodies driven into one another, a step too long) doesn't end it: the search is turned back towards the best point so far.
//!
//! Through contact a trajectory's own gradient may say little: [`smoothed`] averages it over a neighbourhood, [`continuation`] descends softer contact first, and
//! [`grasp()`] is a recipe of these, pushes and an evolution strategy with which a gripper catches what it hasn't seen.
//!
//! [`identify()`] finds parameters from recordings, by exact Jacobians of rollouts, and says how well they are known.
//!
//! Where steps' Jacobians say enough, [`ilqr()`] finds controls in tens of iterations, within limits and with the feedback that holds a robot to them; [`Mpc`] does so again and
//! again from where a plant has got to.
//!
//! # References
//! J. Nocedal, "Updating Quasi-Newton Matrices with Limited Storage", 1980; J. Moré and D. Thuente, "Line Search Algorithms with
//! Guaranteed Sufficient Decrease", 1994.

mod continuation;
mod cost;
mod descent;
mod grasp;
mod identify;
mod ilqr;
mod mpc;
mod smoothed;

pub use continuation::continuation;
pub use cost::{Cost, CostPoint, CustomCost, Quadratic, Target, Term, Weights, terms};
pub use descent::minimise;
pub use grasp::{Finger, Grasp, GraspCost, GraspSettings, GraspStage, GraspTask, grasp};
pub use identify::{
    Experiment, Fitted, Identified, IdentifyProgress, IdentifySettings, IdentifyStop, Loss, Prior,
    Profile, Recorded, SeriesFit, Unknown, WeakDirection, identify,
};
pub use ilqr::{
    Guess, IlqrProgress, IlqrSettings, IlqrStop, IlqrTimes, Plan, Problem, Track, Tracking, ilqr,
};
pub use mpc::{Mpc, MpcProgress, MpcRun, MpcSettings, Replan};
pub use smoothed::{Estimate, Smoothed, Smoothing, smoothed};

use crate::simulate::{Controls, Objective, Simulator};
use crate::{Error, Result};
use nalgebra::DMatrix;
use serde::Serialize;

/// When and how far to descend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptimizeSettings {
    /// Most iterations.
    pub iterations: usize,
    /// Most evaluations of value and gradient.
    pub evaluations: usize,
    /// Pairs of steps and gradient changes that are remembered.
    pub memory: usize,
    /// Length of the first trial step, in units of x; `None`: a hundredth of the step that alone would take the cost to
    /// zero, as far as the gradient tells.
    pub first_step: Option<f64>,
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

impl Default for OptimizeSettings {
    fn default() -> Self {
        Self {
            iterations: 100,
            evaluations: 1000,
            memory: 10,
            first_step: Some(0.1),
            gradient_tolerance: 1e-6,
            cost_tolerance: 1e-9,
            target: None,
            clip: None,
        }
    }
}

/// State of a descent after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptimizeProgress {
    /// Iterations made.
    pub iteration: usize,
    /// Cost.
    pub cost: f64,
    /// Length of the gradient, after [`OptimizeSettings::clip`].
    pub gradient: f64,
    /// Values and gradients evaluated.
    pub evaluations: usize,
}

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The cost reached [`OptimizeSettings::target`].
    Target,
    /// The gradient fell below [`OptimizeSettings::gradient_tolerance`].
    Gradient,
    /// The cost fell by less than [`OptimizeSettings::cost_tolerance`], or no trial along the direction made it fall.
    Cost,
    /// [`OptimizeSettings::iterations`] or [`OptimizeSettings::evaluations`] are used up.
    Budget,
}

/// Where a descent ended: the best point that it saw, controls or plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimum<X = Vec<f64>> {
    /// The point.
    pub x: X,
    /// Its cost.
    pub cost: f64,
    /// Length of its gradient, after [`OptimizeSettings::clip`].
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

/// Open-loop controls that lower an objective, from `start`, with the default [`OptimizeSettings`] but for the first step,
/// which follows from the cost and its gradient there.
///
/// # Errors
/// The rollout of `start` fails, or the objective doesn't fit the scene.
pub fn lbfgs(
    simulator: &Simulator,
    start: Controls,
    objective: &dyn Objective,
) -> Result<Optimum<Controls>> {
    let (rows, columns) = start.matrix().shape();
    let controls =
        |x: &[f64]| Controls::from_matrix(simulator, DMatrix::from_column_slice(rows, columns, x));
    let evaluate = |x: &[f64]| {
        let rollout = simulator.rollout(&controls(x)?)?;
        let cost = rollout.value(objective)?;
        let gradient = rollout.gradient(objective)?.controls;
        Ok((cost, gradient.as_slice().to_vec()))
    };
    let settings = OptimizeSettings {
        first_step: None,
        ..OptimizeSettings::default()
    };
    let found = minimise(evaluate, start.matrix().as_slice(), &settings, |_| {})?;
    Ok(Optimum {
        x: controls(&found.x)?,
        cost: found.cost,
        gradient: found.gradient,
        iterations: found.iterations,
        evaluations: found.evaluations,
        failures: found.failures,
        stop: found.stop,
    })
}

impl OptimizeSettings {
    /// Checks the values.
    fn validate(&self) -> Result<()> {
        let count = |n: usize| n as f64;
        let (positive, least) = ("must be a positive number", "must be at least 1");
        let not_negative = "must be zero or a positive number";
        let fields = [
            ("first_step", self.first_step.unwrap_or(1.0), positive),
            ("clip", self.clip.unwrap_or(1.0), positive),
            ("gradient_tolerance", self.gradient_tolerance, not_negative),
            ("cost_tolerance", self.cost_tolerance, not_negative),
            ("iterations", count(self.iterations), least),
            ("evaluations", count(self.evaluations), least),
            ("memory", count(self.memory), least),
        ];
        for (name, value, expected) in fields {
            let zero = value == 0.0 && expected == not_negative;
            if !(value.is_finite() && (value > 0.0 || zero)) {
                let place = format!("optimize settings: {name}");
                return Err(Error::input(place, value, expected));
            }
        }
        match self.target {
            Some(target) if target.is_nan() => Err(Error::input(
                "optimize settings: target",
                target,
                "must be a number",
            )),
            _ => Ok(()),
        }
    }
}
