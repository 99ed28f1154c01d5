//! When and how far to search, and what is told on the way.

use crate::{Error, Result};
use serde::Serialize;

/// How residuals count, by their size in deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// r²: right for noise that is Gaussian.
    #[default]
    Squared,
    /// r² up to the size given, 2 k |r| − k² beyond.
    Huber(f64),
    /// k² ln(1 + r²/k²) for the size k given: what lies far off hardly counts.
    Cauchy(f64),
}

impl Loss {
    /// ρ(r²) and its derivative by r².
    pub(super) fn of(self, r: f64) -> (f64, f64) {
        let square = r * r;
        match self {
            Self::Huber(k) if r.abs() > k => (2.0 * k * r.abs() - k * k, k / r.abs()),
            Self::Squared | Self::Huber(_) => (square, 1.0),
            Self::Cauchy(k) => {
                let part = square / (k * k);
                (k * k * part.ln_1p(), 1.0 / (1.0 + part))
            }
        }
    }
}

/// When and how far to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifySettings {
    /// Most iterations, those whose step was refused included.
    pub iterations: usize,
    /// How residuals count.
    pub loss: Loss,
    /// Damping of the first iteration, in parts of the curvature.
    pub damping: f64,
    /// Ends once an iteration lowers the misfit by less than this part of itself.
    pub cost_tolerance: f64,
    /// Ends once no unknown changes by more than this part of its standard error.
    pub step_tolerance: f64,
    /// Of how many of the directions that are known least the misfit is simulated.
    pub profiles: usize,
}

impl Default for IdentifySettings {
    fn default() -> Self {
        Self {
            iterations: 50,
            loss: Loss::Squared,
            damping: 1e-6,
            cost_tolerance: 1e-8,
            step_tolerance: 1e-3,
            profiles: 1,
        }
    }
}

impl IdentifySettings {
    /// Checks the values.
    pub(super) fn validate(&self) -> Result<()> {
        let size = match self.loss {
            Loss::Squared => 1.0,
            Loss::Huber(k) | Loss::Cauchy(k) => k,
        };
        let fields = [
            ("loss", size, true),
            ("damping", self.damping, true),
            ("cost_tolerance", self.cost_tolerance, false),
            ("step_tolerance", self.step_tolerance, false),
        ];
        for (name, value, positive) in fields {
            if !(value.is_finite() && value >= 0.0 && (value > 0.0 || !positive)) {
                let expected = match positive {
                    true => "must be a positive number",
                    false => "must be zero or a positive number",
                };
                return Err(Error::input(format!("identify: {name}"), value, expected));
            }
        }
        Ok(())
    }
}

/// State of a search after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifyProgress {
    /// Iterations made.
    pub iteration: usize,
    /// Misfit.
    pub cost: f64,
    /// Whether the step was taken.
    pub taken: bool,
    /// Largest change of an unknown in its standard errors.
    pub step: f64,
    /// Simulations so far, those of all experiments.
    pub simulations: usize,
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum IdentifyStop {
    /// The misfit fell by less than [`IdentifySettings::cost_tolerance`].
    Cost,
    /// The unknowns moved by less than [`IdentifySettings::step_tolerance`].
    Step,
    /// No step, however short, lowered the misfit.
    Stuck,
    /// [`IdentifySettings::iterations`] are used up.
    Budget,
    /// The caller asked for it.
    Asked,
}
