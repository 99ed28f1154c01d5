//! What was found, and how well it is known.

use super::marquardt::Found;
use super::misfit::Misfit;
use super::unknown::Target;
use super::{IdentifySettings, IdentifyStop};
use crate::dynamics::Parameters;
use crate::simulate::Simulator;
use crate::simulate::observable::observable;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Eigenvalues of the information below this part of the largest are rounding.
const SINGULAR: f64 = 1e-14;
/// At how many deviations along a direction the misfit is simulated.
const PROFILE: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];

/// One unknown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fitted {
    /// Its name.
    pub name: String,
    /// Its value, in its unit.
    pub value: f64,
    /// Its standard error by the deviations that were given, in its unit; infinite where nothing tells it, zero at a bound.
    pub standard_error: f64,
    /// Where the search began.
    pub start: f64,
    /// Whether a bound holds it; what is said of the others then takes it as known.
    pub at_bound: bool,
    /// Its standard error in parts of what was known beforehand; about 1: the recordings tell nothing of it.
    pub of_prior: Option<f64>,
    /// The parameters that it sets, and what each is of it.
    pub sets: Vec<(String, f64)>,
    /// The coordinates of the start that it sets, and what each is of it.
    pub starts: Vec<(String, f64)>,
}

/// How one entry of an experiment was met.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeriesFit {
    /// The experiment.
    pub experiment: String,
    /// The observable.
    pub observable: String,
    /// The entry's label.
    pub label: String,
    /// Root mean square of simulated less recorded, in the observable's unit.
    pub rms: f64,
    /// Correlation of one residual with the next: noise has none, what the model lacks has.
    pub autocorrelation: f64,
}

/// The misfit at a point along a direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Profile {
    /// How far from the best point, in standard deviations along the direction.
    pub deviations: f64,
    /// How much the misfit rises; null where the simulation fails.
    pub rise: Option<f64>,
    /// How much it would if it were a parabola: ½ of the square.
    pub expected: f64,
}

/// A direction in which the unknowns are told least.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WeakDirection {
    /// Change of each unknown by one standard deviation along it, in its unit.
    pub change: Vec<f64>,
    /// The standard deviation along it, in parts of the unknowns' sizes; infinite where nothing tells it.
    pub deviation: f64,
    /// The misfit along it; empty where the deviation is infinite.
    pub profile: Vec<Profile>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identified {
    /// The unknowns, in order.
    pub unknowns: Vec<Fitted>,
    /// Correlations of their errors.
    pub correlations: Vec<Vec<f64>>,
    /// Initial coordinates and velocity of each experiment.
    pub starts: Vec<(Vec<f64>, Vec<f64>)>,
    /// How each series was met.
    pub series: Vec<SeriesFit>,
    /// The misfit.
    pub cost: f64,
    /// Sum of squared residuals over the degrees of freedom: 1 for noise as large as it is said to be.
    pub chi_squared: f64,
    /// What standard errors are to be multiplied by where residuals aren't that noise: √(χ² (1 + ρ)/(1 − ρ)), at least 1, ρ being the mean autocorrelation.
    pub inflation: f64,
    /// The directions that are told least, the least one first.
    pub weak: Vec<WeakDirection>,
    /// Iterations made.
    pub iterations: usize,
    /// Simulations, those of all experiments, profiles included.
    pub simulations: usize,
    /// Jacobians of all experiments.
    pub jacobians: usize,
    /// Trials whose simulation failed.
    pub failures: usize,
    /// Why it ended.
    pub stop: IdentifyStop,
}

impl Identified {
    /// The value of an unknown.
    ///
    /// # Errors
    /// A name that none has.
    pub fn value(&self, name: &str) -> Result<f64> {
        let found = self.unknowns.iter().find(|u| u.name == name);
        found.map(|u| u.value).ok_or_else(|| {
            let names: Vec<&str> = self.unknowns.iter().map(|u| u.name.as_str()).collect();
            Error::input(
                "unknown",
                format!("{name:?}"),
                format!("must be one of {names:?}"),
            )
        })
    }

    /// A simulator's parameters with what was found.
    ///
    /// # Errors
    /// A simulator that lacks one of them.
    pub fn parameters(&self, simulator: &Simulator) -> Result<Parameters> {
        let mut out = simulator.parameters().clone();
        for unknown in &self.unknowns {
            for (name, factor) in &unknown.sets {
                out.set(name, factor * unknown.value)?;
            }
        }
        Ok(out)
    }
}

/// Inverse of the information, of coordinates that no bound holds, and the directions that it tells least of.
struct Known {
    covariance: DMatrix<f64>,
    /// Direction (a deviation along it, in coordinates of the search) and deviation in parts of sizes.
    directions: Vec<(DVector<f64>, f64)>,
}

impl Known {
    fn new(information: &DMatrix<f64>, held: &[bool], sizes: &DVector<f64>) -> Self {
        let n = sizes.len();
        let free: Vec<usize> = (0..n).filter(|i| !held[*i]).collect();
        if free.is_empty() {
            return Self {
                covariance: DMatrix::zeros(n, n),
                directions: Vec::new(),
            };
        }
        let scaled = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            let (a, b) = (free[i], free[j]);
            sizes[a] * information[(a, b)] * sizes[b]
        });
        let decomposed = scaled.symmetric_eigen();
        let top = decomposed.eigenvalues.iter().copied().fold(0.0, f64::max);
        let mut covariance = DMatrix::zeros(n, n);
        let mut directions = Vec::new();
        for (value, vector) in
            (decomposed.eigenvalues.iter()).zip(decomposed.eigenvectors.column_iter())
        {
            let deviation = match *value > SINGULAR * top {
                true => 1.0 / value.sqrt(),
                false => f64::INFINITY,
            };
            let mut direction = DVector::zeros(n);
            for (k, i) in free.iter().enumerate() {
                direction[*i] = sizes[*i] * vector[k];
            }
            for i in 0..n {
                for j in 0..n {
                    let part = direction[i] * direction[j];
                    // Nothing times infinity is nothing here.
                    let seen = part.abs() > SINGULAR.sqrt() * sizes[i] * sizes[j];
                    if deviation.is_finite() || seen {
                        covariance[(i, j)] += deviation * deviation * part;
                    }
                }
            }
            directions.push((direction, deviation));
        }
        directions.sort_by(|a, b| b.1.total_cmp(&a.1));
        Self {
            covariance,
            directions,
        }
    }

    fn error(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    fn correlation(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (self.error(i), self.error(j));
        let both = self.covariance[(i, j)] / (a * b);
        match both.is_finite() {
            true => both.clamp(-1.0, 1.0),
            false => f64::from(i == j),
        }
    }
}

/// Correlation of each residual with the next.
fn autocorrelation(r: &[f64]) -> f64 {
    let square: f64 = r.iter().map(|x| x * x).sum();
    let beside: f64 = r.windows(2).map(|w| w[0] * w[1]).sum();
    if square > 0.0 { beside / square } else { 0.0 }
}

pub(super) fn report(
    misfit: &Misfit,
    found: Found,
    settings: &IdentifySettings,
) -> Result<Identified> {
    let Found {
        best,
        linear,
        iterations,
        mut simulations,
        jacobians,
        failures,
        stop,
    } = found;
    let x = &best.x;
    let n = misfit.unknowns.len();
    let held: Vec<bool> = (0..x.len())
        .map(|i| misfit.bounds(i).contains(&x[i]))
        .collect();
    // What a deviation is a part of.
    let sizes = DVector::from_fn(x.len(), |i, _| match misfit.unknowns.get(i) {
        Some(u) if !u.by_logarithm => match u.prior {
            Some(prior) => prior.deviation,
            None if x[i] != 0.0 => x[i].abs(),
            None => 1.0,
        },
        _ => 1.0,
    });
    let information = linear.jacobian.tr_mul(&linear.jacobian);
    let known = Known::new(&information, &held, &sizes);
    let mut weak = Vec::new();
    for (direction, deviation) in known.directions.iter().take(settings.profiles) {
        let mut profile = Vec::new();
        if deviation.is_finite() {
            for k in PROFILE {
                let mut to = x + k * *deviation * direction;
                for i in 0..to.len() {
                    let [least, largest] = misfit.bounds(i);
                    to[i] = to[i].clamp(least, largest);
                }
                simulations += misfit.experiments.len();
                let rise = misfit.evaluate(&to).ok().map(|e| e.cost - best.cost);
                profile.push(Profile {
                    deviations: k,
                    rise: rise.filter(|x| x.is_finite()),
                    expected: 0.5 * k * k,
                });
            }
        }
        let by = if deviation.is_finite() {
            *deviation
        } else {
            1.0
        };
        let change = (misfit.unknowns.iter().enumerate())
            .map(|(i, u)| by * direction[i] * u.slope(x[i]))
            .collect();
        weak.push(WeakDirection {
            change,
            deviation: *deviation,
            profile,
        });
    }
    let unknowns = misfit.unknowns.iter().enumerate().map(|(i, u)| {
        let error = known.error(i);
        let (starts, sets): (Vec<_>, Vec<_>) =
            (u.sets.iter()).partition(|(target, _)| matches!(target, Target::Start(_)));
        let named = |sets: Vec<&(Target, f64)>| {
            let each = sets.into_iter();
            each.map(|(target, factor)| (target.name().to_string(), *factor))
                .collect()
        };
        Fitted {
            name: u.name.clone(),
            value: u.value(x[i]),
            standard_error: error * u.slope(x[i]),
            start: u.value(u.start),
            at_bound: held[i],
            of_prior: u.prior.map(|prior| error / prior.deviation),
            sets: named(sets),
            starts: named(starts),
        }
    });
    let correlations = (0..n).map(|i| (0..n).map(|j| known.correlation(i, j)).collect());
    let starts = (0..misfit.experiments.len()).map(|k| {
        let (q, v) = misfit.initial(k, x);
        (q.as_slice().to_vec(), v.as_slice().to_vec())
    });
    let mut series = Vec::new();
    let (mut squares, mut count, mut correlated) = (0.0, 0, 0.0);
    for (experiment, r) in misfit.experiments.iter().zip(&best.differences) {
        let mut from = 0;
        for seen in &experiment.recorded {
            let r = &r.as_slice()[from..from + seen.states.len()];
            from += seen.states.len();
            let square: f64 = r.iter().map(|x| x * x).sum();
            let own = autocorrelation(r);
            squares += square;
            count += r.len();
            correlated += own * r.len() as f64;
            let labels = observable(&seen.observable)?.labels(experiment.simulator.scene());
            series.push(SeriesFit {
                experiment: experiment.name.clone(),
                observable: seen.observable.clone(),
                label: labels.get(seen.entry).cloned().unwrap_or_default(),
                rms: seen.deviation * (square / r.len().max(1) as f64).sqrt(),
                autocorrelation: own,
            });
        }
        if !experiment.derived.is_empty() {
            let r = &r.as_slice()[from..];
            let square: f64 = r.iter().map(|x| x * x).sum();
            squares += square;
            count += r.len();
            let names = experiment
                .derived
                .iter()
                .flat_map(|d| d.observables.clone());
            series.push(SeriesFit {
                experiment: experiment.name.clone(),
                observable: names.collect::<Vec<_>>().join(", "),
                label: "function".into(),
                rms: (square / r.len().max(1) as f64).sqrt(),
                autocorrelation: 0.0,
            });
        }
    }
    let freedom = count
        .saturating_sub(held.iter().filter(|h| !**h).count())
        .max(1);
    let chi_squared = squares / freedom as f64;
    let rho = (correlated / count.max(1) as f64).clamp(0.0, 0.999);
    Ok(Identified {
        unknowns: unknowns.collect(),
        correlations: correlations.collect(),
        starts: starts.collect(),
        series,
        cost: best.cost,
        chi_squared,
        inflation: (chi_squared * (1.0 + rho) / (1.0 - rho)).sqrt().max(1.0),
        weak,
        iterations,
        simulations,
        jacobians,
        failures,
        stop,
    })
}
