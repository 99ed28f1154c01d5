//! What was found, and how well it is known.

use super::marquardt::Found;
use super::misfit::Misfit;
use super::root;
use super::unknown::Target;
use super::{Experiment, IdentifySettings, IdentifyStop, Loss};
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
    /// Its standard error in parts of what was known beforehand; about 1: the recordings tell nothing of it. None at a bound, and where nothing was known.
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
    /// Inertias whose roots were unknown, as parameters, in the first experiment.
    pub inertias: Vec<(String, f64)>,
    /// Correlations of their errors.
    pub correlations: Vec<Vec<f64>>,
    /// Initial coordinates and velocity of each experiment.
    pub starts: Vec<(Vec<f64>, Vec<f64>)>,
    /// How each series was met.
    pub series: Vec<SeriesFit>,
    /// The misfit.
    pub cost: f64,
    /// Sum of squared residuals, weighed by the loss, over the degrees of freedom that the recordings have left: 1 for noise as large as it is said to be.
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

    /// A simulator's parameters with what was found; an experiment's own scales aren't in them.
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
        for (name, value) in &self.inertias {
            out.set(name, *value)?;
        }
        Ok(out)
    }
}

/// Inverse of the information, of coordinates that no bound holds, and the directions that it tells least of.
struct Known {
    covariance: DMatrix<f64>,
    /// Change of the coordinates of the search by one standard deviation along a direction, and its largest in parts of sizes; of what nothing tells any change, and infinity.
    directions: Vec<(DVector<f64>, f64)>,
}

impl Known {
    fn new(information: &DMatrix<f64>, held: &[bool], told: &[bool], sizes: &DVector<f64>) -> Self {
        let n = sizes.len();
        let mut covariance = DMatrix::zeros(n, n);
        let mut directions = Vec::new();
        let (told, untold): (Vec<usize>, Vec<usize>) =
            (0..n).filter(|i| !held[*i]).partition(|i| told[*i]);
        for i in untold {
            covariance[(i, i)] = f64::INFINITY;
            let change = DVector::from_fn(n, |k, _| if k == i { sizes[i] } else { 0.0 });
            directions.push((change, f64::INFINITY));
        }
        if !told.is_empty() {
            // Each in what alone would be its standard error: units play no part.
            let scale = |k: usize| 1.0 / information[(told[k], told[k])].sqrt();
            let scaled = DMatrix::from_fn(told.len(), told.len(), |i, j| {
                scale(i) * information[(told[i], told[j])] * scale(j)
            });
            let decomposed = scaled.symmetric_eigen();
            let pairs = decomposed.eigenvalues.iter();
            for (value, vector) in pairs.zip(decomposed.eigenvectors.column_iter()) {
                let is_told = *value > SINGULAR * told.len() as f64;
                let by = if is_told { 1.0 / value.sqrt() } else { 1.0 };
                let mut change = DVector::zeros(n);
                for (k, i) in told.iter().enumerate() {
                    change[*i] = by * scale(k) * vector[k];
                }
                // What takes no part in it isn't untold by it.
                let part = |k: usize| vector[k].abs() > SINGULAR.sqrt();
                for (a, &i) in told.iter().enumerate() {
                    for (b, &j) in told.iter().enumerate() {
                        let product = change[i] * change[j];
                        covariance[(i, j)] += match (is_told, part(a) && part(b)) {
                            (true, _) => product,
                            (false, true) => product.signum() * f64::INFINITY,
                            (false, false) => 0.0,
                        };
                    }
                }
                let deviation = change.component_div(sizes).amax();
                directions.push((change, if is_told { deviation } else { f64::INFINITY }));
            }
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
    let x = &found.best.x;
    let n = misfit.unknowns.len();
    let held: Vec<bool> = (0..x.len())
        .map(|i| misfit.bounds(i).contains(&x[i]))
        .collect();
    let jacobian = &found.linear.jacobian;
    let information = jacobian.tr_mul(jacobian);
    let told = misfit.told(x, jacobian);
    let known = Known::new(&information, &held, &told, &misfit.sizes(x));
    let least = known.directions.iter().take(settings.profiles);
    let weak = least.map(|(change, deviation)| {
        let profile = match deviation.is_finite() {
            true => profile(misfit, &found, change)?,
            false => Vec::new(),
        };
        let each = misfit.unknowns.iter().enumerate();
        Ok(WeakDirection {
            change: each.map(|(i, u)| change[i] * u.slope(x[i])).collect(),
            deviation: *deviation,
            profile,
        })
    });
    let weak = weak.collect::<Result<Vec<_>>>()?;
    let profiled: usize = weak.iter().map(|w| w.profile.len()).sum();
    let unknowns = misfit.unknowns.iter().enumerate().map(|(i, u)| {
        let error = known.error(i);
        let (starts, sets): (Vec<_>, Vec<_>) =
            (u.sets.iter()).partition(|(target, _)| matches!(target, Target::Start(_)));
        let named = |sets: Vec<&(Target, f64)>| {
            let each = sets.into_iter();
            each.filter(|(target, _)| !matches!(target, Target::Root { .. }))
                .map(|(target, factor)| (target.name().to_string(), *factor))
                .collect()
        };
        Fitted {
            name: u.name.clone(),
            value: u.value(x[i]),
            standard_error: error * u.slope(x[i]),
            start: u.value(u.start),
            at_bound: held[i],
            of_prior: (u.prior.filter(|_| !held[i])).map(|prior| error / prior.deviation),
            sets: named(sets),
            starts: named(starts),
        }
    });
    let correlations = (0..n).map(|i| (0..n).map(|j| known.correlation(i, j)).collect());
    let starts = (0..misfit.experiments.len()).map(|k| {
        let (q, v) = misfit.initial(k, x);
        (q.as_slice().to_vec(), v.as_slice().to_vec())
    });
    let inertias = misfit.roots(0, x)?.into_iter().flat_map(|(body, found)| {
        root::parameters(&body)
            .into_iter()
            .zip(root::inertia(&found))
    });
    let mut met = Met::default();
    for (experiment, r) in misfit.experiments.iter().zip(&found.best.differences) {
        met.add(experiment, r.as_slice(), misfit.loss)?;
    }
    // What priors know already isn't taken from the data.
    let mut used: Vec<f64> = held.iter().map(|h| if *h { 0.0 } else { 1.0 }).collect();
    for (i, prior) in misfit.priors() {
        used[i] *= (1.0 - (known.error(i) / prior.deviation).powi(2)).clamp(0.0, 1.0);
    }
    let freedom = (met.count - used.iter().sum::<f64>()).max(1.0);
    let chi_squared = met.squares / freedom;
    let rho = (met.correlated / met.count.max(1.0)).clamp(0.0, 0.999);
    Ok(Identified {
        unknowns: unknowns.collect(),
        inertias: inertias.collect(),
        correlations: correlations.collect(),
        starts: starts.collect(),
        series: met.series,
        cost: found.best.cost,
        chi_squared,
        inflation: (chi_squared * (1.0 + rho) / (1.0 - rho)).sqrt().max(1.0),
        weak,
        iterations: found.iterations,
        simulations: found.simulations + profiled * misfit.experiments.len(),
        jacobians: found.jacobians,
        failures: found.failures,
        stop: found.stop,
    })
}

/// The misfit along a change of one deviation.
fn profile(misfit: &Misfit, found: &Found, change: &DVector<f64>) -> Result<Vec<Profile>> {
    let Found { best, linear, .. } = found;
    let at = |k: f64| {
        let to = misfit.within(&best.x + k * change);
        // Bounds may be nearer.
        let expected = 0.5 * (&linear.jacobian * (&to - &best.x)).norm_squared();
        let rise = match misfit.evaluate(&to) {
            Ok(found) => Some(found.cost - best.cost),
            Err(stop) if stop.ends_search() => return Err(stop),
            Err(_) => None,
        };
        Ok(Profile {
            deviations: k,
            rise: rise.filter(|x| x.is_finite()),
            expected,
        })
    };
    PROFILE.into_iter().map(at).collect()
}

/// How the recordings are met; what a loss forgives counts as little in its sums.
#[derive(Default)]
struct Met {
    series: Vec<SeriesFit>,
    squares: f64,
    count: f64,
    correlated: f64,
}

impl Met {
    /// With the residuals of an experiment.
    fn add(&mut self, experiment: &Experiment, r: &[f64], loss: Loss) -> Result<()> {
        let mut from = 0;
        for seen in &experiment.recorded {
            let own = &r[from..from + seen.states.len()];
            from += own.len();
            let autocorrelation = self.weigh(own, loss);
            let labels = observable(&seen.observable)?.labels(experiment.simulator.scene());
            self.series.push(SeriesFit {
                experiment: experiment.name.clone(),
                observable: seen.observable.clone(),
                label: labels.get(seen.entry).cloned().unwrap_or_default(),
                rms: seen.deviation * rms(own),
                autocorrelation,
            });
        }
        for of in &experiment.derived {
            let own = &r[from..from + of.residuals()];
            from += own.len();
            self.weigh(own, loss);
            self.series.push(SeriesFit {
                experiment: experiment.name.clone(),
                observable: of.observables.join(", "),
                label: "function".into(),
                rms: rms(own),
                autocorrelation: 0.0,
            });
        }
        Ok(())
    }

    /// Adds residuals, each by the loss; their autocorrelation.
    fn weigh(&mut self, r: &[f64], loss: Loss) -> f64 {
        let weights: Vec<f64> = r.iter().map(|r| loss.of(*r).1).collect();
        let weighed: Vec<f64> = (r.iter().zip(&weights))
            .map(|(r, w)| w.sqrt() * r)
            .collect();
        let weight: f64 = weights.iter().sum();
        let own = autocorrelation(&weighed);
        self.squares += weighed.iter().map(|x| x * x).sum::<f64>();
        self.count += weight;
        self.correlated += own * weight;
        own
    }
}

fn rms(r: &[f64]) -> f64 {
    let square: f64 = r.iter().map(|x| x * x).sum();
    (square / r.len().max(1) as f64).sqrt()
}
