//! Parameters from recordings: least squares over rollouts, by Levenberg and Marquardt on their exact Jacobians.
//!
//! Each recording is an [`Experiment`]: a simulator that starts as it did, with the inputs that it had (controls, and joints that motions drive), and what was seen of it
//! ([`Recorded`]). All share the [`Unknown`]s, parameters of the simulator by name; an experiment's own initial state may be unknown besides. The misfit is
//!
//! ```text
//! Φ = ½ Σ ρ(r²) + ½ Σ ((x − x₀)/σ)²        r = (simulated − recorded)/deviation
//! ```
//!
//! with a loss ρ that forgives what lies far off, and what was known beforehand of the unknowns, x₀ ± σ. The Jacobian is that of forward mode ([`Rollout::jacobian`]): a run for all
//! columns; where an experiment has fewer residuals than columns, that of the reverse sweep. Where the misfit is least its curvature gives standard errors, their
//! correlations, and the directions that the recordings tell least of, along which the misfit is then simulated.
//!
//! # References
//! D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; J. Moré, "The Levenberg–Marquardt algorithm: implementation and theory", 1978;
//! H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05; P. J. Huber, *Robust Statistics*, 1981.

mod derived;
mod experiment;
mod marquardt;
mod misfit;
mod report;
mod root;
mod settings;
mod unknown;

pub use experiment::{Experiment, Recorded};
pub use report::{Fitted, Identified, Profile, SeriesFit, WeakDirection};
pub use settings::{IdentifyProgress, IdentifySettings, IdentifyStop, Loss};
pub use unknown::{Prior, Unknown};

use crate::Result;
use marquardt::Marquardt;
use misfit::Misfit;
use std::ops::ControlFlow;

/// The unknowns that fit the recordings best, and how well they are known. `progress` is called after every iteration and may end the search; the best so far is then found.
///
/// # Errors
/// No experiment or unknown; names, entries, states and numbers that don't fit; a start whose simulation fails. Trials that fail are shortened instead.
pub fn identify(
    experiments: &[Experiment],
    unknowns: &[Unknown],
    settings: &IdentifySettings,
    mut progress: impl FnMut(&IdentifyProgress) -> ControlFlow<()>,
) -> Result<Identified> {
    settings.validate()?;
    let misfit = Misfit::new(experiments, unknowns, settings.loss)?;
    let found = Marquardt::new(&misfit, settings).solve(&mut progress)?;
    report::report(&misfit, found, settings)
}
