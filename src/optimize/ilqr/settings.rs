//! How far iLQR goes, and how it tells.

use crate::{Error, Result};
use serde::Serialize;

/// When and how far to iterate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IlqrSettings {
    /// Most iterations, those that find nothing better included.
    pub iterations: usize,
    /// Ends once an iteration lowers the cost, or expects to, by less than this part of it.
    pub tolerance: f64,
    /// Ends once the cost is no larger.
    pub target: Option<f64>,
    /// Regularisation at the start: the part by which each control's curvature is made larger.
    pub regularisation: f64,
    /// Regularisation past which it gives up.
    pub most_regularisation: f64,
    /// Most lengths of a step that are tried, each half of the one before.
    pub trials: usize,
    /// Whether gains are found once more for the trajectory at the end; without, they are those of the trajectory before its last step, which costs less.
    pub last_gains: bool,
}

impl Default for IlqrSettings {
    fn default() -> Self {
        Self {
            iterations: 100,
            tolerance: 1e-9,
            target: None,
            regularisation: 0.0,
            most_regularisation: 1e8,
            trials: 10,
            last_gains: true,
        }
    }
}

impl IlqrSettings {
    pub(in crate::optimize) fn validate(&self) -> Result<()> {
        let refuse = |name: &str, value: f64, expected: &str| {
            Err(Error::input(
                format!("ilqr settings: {name}"),
                value,
                expected,
            ))
        };
        for (name, value) in [
            ("tolerance", self.tolerance),
            ("regularisation", self.regularisation),
            ("most_regularisation", self.most_regularisation),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(name, value, "must be finite and not negative");
            }
        }
        for (name, count) in [("iterations", self.iterations), ("trials", self.trials)] {
            if count == 0 {
                return refuse(name, 0.0, "must be at least 1");
            }
        }
        match self.target {
            Some(target) if target.is_nan() => refuse("target", target, "must be a number"),
            _ => Ok(()),
        }
    }
}

/// State of iLQR after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IlqrProgress {
    /// Iterations made.
    pub iteration: usize,
    /// Cost.
    pub cost: f64,
    /// Fall of the cost that the model of the iteration expected.
    pub expected: f64,
    /// Part of the step that was taken; 0: none. The regularisation grows after none, and after an eighth or less.
    pub part: f64,
    /// Regularisation of the iteration.
    pub regularisation: f64,
    /// Largest entry of the gradient by the controls, where no limit holds them, at the start of the iteration.
    pub gradient: f64,
}

/// Why iLQR ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum IlqrStop {
    /// The model of the trajectory expects less than [`IlqrSettings::tolerance`] of any step: a point at which the gradient is zero but for what limits hold.
    Stationary,
    /// A whole step lowered the cost by less than [`IlqrSettings::tolerance`].
    Cost,
    /// The cost reached [`IlqrSettings::target`].
    Target,
    /// No step lowered the cost, with all regularisation that is allowed or as much as leaves no step worth a trial.
    Stuck,
    /// [`IlqrSettings::iterations`] are used up.
    Budget,
    /// Whoever was told of the progress asked for it.
    Asked,
}

/// Where the time went, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct IlqrTimes {
    /// Simulating: the start and all trials.
    pub rollouts: f64,
    /// Jacobians of steps, and derivatives of the cost.
    pub derivatives: f64,
    /// Sweeps from the last knot to the first.
    pub sweeps: f64,
    /// In all.
    pub total: f64,
}
