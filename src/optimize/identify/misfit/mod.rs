//! The misfit of all experiments, with its residuals.

mod jacobian;

use super::root;
use super::unknown::{Prior, Searched, Target};
use super::{Experiment, Loss, Unknown};
use crate::dynamics::Drive;
use crate::error::in_order;
use crate::simulate::{Rollout, Simulator};
use crate::{Error, Result};
pub(super) use jacobian::Linear;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// The unknown initial state of an experiment.
struct Start {
    /// Where its coordinates begin among those of the search.
    from: usize,
    /// Generalised velocities that nothing drives.
    free: Vec<usize>,
    /// Deviations of coordinates and velocities; zero: known exactly.
    deviations: [f64; 2],
}

impl Start {
    fn parts(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let known = self.deviations.iter().enumerate();
        let parts = known.filter(|(_, d)| **d > 0.0);
        parts
            .enumerate()
            .map(|(i, (part, d))| (self.from + i * self.free.len(), part, *d))
    }

    fn len(&self) -> usize {
        self.parts().count() * self.free.len()
    }
}

/// What an unknown sets in an experiment.
struct Setting {
    /// The unknown.
    unknown: usize,
    /// What is set, over the unknown.
    factor: f64,
    place: Place,
}

enum Place {
    /// A parameter, by its name.
    Parameter(String),
    /// A coordinate of the start, and the velocity that is its rate.
    Start { q: usize, v: usize },
    /// An entry of the root of a body's inertia.
    Root { body: String, entry: usize },
}

/// Of what a change of a coordinate by its own size changes in the residuals, in that of the coordinate which they tell most of: what is less is rounding.
const UNTOLD: f64 = 1e-12;

/// A misfit: a function of the coordinates of the search, the unknowns' and then those of initial states.
pub(super) struct Misfit<'a> {
    pub experiments: &'a [Experiment],
    pub unknowns: Vec<Searched>,
    /// Of each experiment.
    settings: Vec<Vec<Setting>>,
    starts: Vec<Option<Start>>,
    pub loss: Loss,
    coordinates: usize,
}

/// The misfit at a point.
pub(super) struct Evaluated {
    pub x: DVector<f64>,
    pub cost: f64,
    /// Of each experiment, in deviations.
    pub differences: Vec<DVector<f64>>,
    rollouts: Vec<Rollout>,
}

impl<'a> Misfit<'a> {
    pub fn new(experiments: &'a [Experiment], unknowns: &[Unknown], loss: Loss) -> Result<Self> {
        let Some(first) = experiments.first() else {
            let remedy = "give at least one";
            return Err(Error::input("identify: experiments", "none", remedy));
        };
        let unknowns = unknowns.iter().map(|u| Searched::new(u, &first.simulator));
        let unknowns = unknowns.collect::<Result<Vec<_>>>()?;
        let (mut names, mut taken) = (BTreeSet::new(), BTreeSet::new());
        for unknown in &unknowns {
            if !names.insert(&unknown.name) {
                let remedy = "another unknown has this name";
                let name = format!("{:?}", unknown.name);
                return Err(Error::input("unknown", name, remedy));
            }
            for (target, _) in &unknown.sets {
                if !taken.insert(target.name()) {
                    let place = format!("unknown {:?}: parameter", unknown.name);
                    let remedy = "another unknown sets it already";
                    return Err(Error::input(place, format!("{:?}", target.name()), remedy));
                }
            }
        }
        for unknown in &unknowns {
            for (target, _) in &unknown.sets {
                if let Target::Root { body, .. } = target {
                    let direct = root::parameters(body);
                    if let Some(name) = direct.iter().find(|n| taken.contains(n.as_str())) {
                        let place = format!("unknown {:?}: parameter", unknown.name);
                        let remedy = "another unknown sets it already, beside the root of the inertia: leave one of them out";
                        return Err(Error::input(place, format!("{name:?}"), remedy));
                    }
                }
            }
        }
        let sets = unknowns.iter().flat_map(|u| &u.sets);
        let parameters = sets.filter_map(|(target, _)| match target {
            Target::Parameter(name) => Some(name.as_str()),
            Target::Start(_) | Target::Root { .. } => None,
        });
        let parameters: BTreeSet<&str> = parameters.collect();
        let mut coordinates = unknowns.len();
        let (mut settings, mut starts) = (Vec::new(), Vec::new());
        for experiment in experiments {
            experiment.check(&parameters)?;
            let own = settings_of(&unknowns, experiment);
            settings.push(own.map_err(|e| e.within(&experiment.place()))?);
            let start = experiment.start.map(|deviations| Start {
                from: coordinates,
                free: free(&experiment.simulator),
                deviations,
            });
            coordinates += start.as_ref().map_or(0, Start::len);
            starts.push(start);
        }
        if coordinates == 0 {
            let remedy = "give an unknown, or an experiment whose start is one";
            return Err(Error::input("identify: unknowns", "none", remedy));
        }
        Ok(Self {
            experiments,
            unknowns,
            settings,
            starts,
            loss,
            coordinates,
        })
    }

    /// Where the search begins.
    pub fn start(&self) -> DVector<f64> {
        let known = self.unknowns.iter().map(|u| u.start);
        let zeros = std::iter::repeat_n(0.0, self.coordinates - self.unknowns.len());
        DVector::from_iterator(self.coordinates, known.chain(zeros))
    }

    /// What changes of coordinates are parts of: their own, or what was known of them beforehand.
    pub fn sizes(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(x.len(), |i, _| match self.unknowns.get(i) {
            Some(u) if !u.by_logarithm => match u.prior {
                Some(prior) => prior.deviation,
                None if x[i] != 0.0 => x[i].abs(),
                None => 1.0,
            },
            _ => 1.0,
        })
    }

    /// Which coordinates the residuals tell something of. Of others the derivatives are rounding, by which no step can be found and no error told.
    pub fn told(&self, x: &DVector<f64>, jacobian: &DMatrix<f64>) -> Vec<bool> {
        let sizes = self.sizes(x);
        let part = |i: usize| jacobian.column(i).norm() * sizes[i];
        let parts: Vec<f64> = (0..x.len()).map(part).collect();
        let most = parts.iter().copied().fold(0.0, f64::max);
        parts.iter().map(|part| *part > UNTOLD * most).collect()
    }

    /// Least and largest value of a coordinate.
    pub fn bounds(&self, i: usize) -> [f64; 2] {
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        self.unknowns.get(i).map_or(none, |u| u.bounds)
    }

    /// The nearest point within the bounds.
    pub fn within(&self, mut x: DVector<f64>) -> DVector<f64> {
        for i in 0..x.len() {
            let [least, largest] = self.bounds(i);
            x[i] = x[i].clamp(least, largest);
        }
        x
    }

    /// Coordinates of which something was known beforehand.
    pub fn priors(&self) -> Vec<(usize, Prior)> {
        let known = self.unknowns.iter().enumerate();
        let mut out: Vec<_> = known.filter_map(|(i, u)| Some((i, u.prior?))).collect();
        for start in self.starts.iter().flatten() {
            for (from, _, deviation) in start.parts() {
                let prior = |i| {
                    (
                        i,
                        Prior {
                            mean: 0.0,
                            deviation,
                        },
                    )
                };
                out.extend((from..from + start.free.len()).map(prior));
            }
        }
        out
    }

    /// An experiment's initial coordinates and velocity.
    pub fn initial(&self, k: usize, x: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
        let simulator = &self.experiments[k].simulator;
        let (q, v) = simulator.start();
        let mut q = q.clone();
        for setting in &self.settings[k] {
            if let Place::Start { q: i, .. } = setting.place {
                q[i] = self.value(setting, x);
            }
        }
        let Some([xi, dv]) = self.displaced(k, x) else {
            return (q, v.clone());
        };
        (simulator.system().tree.integrate(&q, &xi), v + dv)
    }

    /// What a setting is set to.
    fn value(&self, setting: &Setting, x: &DVector<f64>) -> f64 {
        let i = setting.unknown;
        setting.factor * self.unknowns[i].value(x[i])
    }

    /// Roots of the inertias that unknowns set in an experiment, by body.
    pub fn roots(&self, k: usize, x: &DVector<f64>) -> Result<BTreeMap<String, [f64; 6]>> {
        let mut out = BTreeMap::new();
        for setting in &self.settings[k] {
            if let Place::Root { body, entry } = &setting.place {
                if !out.contains_key(body) {
                    out.insert(
                        body.clone(),
                        root::of(&self.experiments[k].simulator, body)?,
                    );
                }
                if let Some(root) = out.get_mut(body) {
                    root[*entry] = self.value(setting, x);
                }
            }
        }
        Ok(out)
    }

    /// Whether unknowns set coordinates of the start.
    fn sets_start(&self, k: usize) -> bool {
        let mut all = self.settings[k].iter();
        all.any(|s| matches!(s.place, Place::Start { .. }))
    }

    /// How far its initial coordinates (tangent) and velocity are from those given.
    fn displaced(&self, k: usize, x: &DVector<f64>) -> Option<[DVector<f64>; 2]> {
        let start = self.starts[k].as_ref()?;
        let n = self.experiments[k].simulator.start().1.len();
        let mut out = [DVector::zeros(n), DVector::zeros(n)];
        for (from, part, _) in start.parts() {
            for (i, v) in start.free.iter().enumerate() {
                out[part][*v] = x[from + i];
            }
        }
        Some(out)
    }

    /// The simulator of an experiment at a point.
    fn simulator(&self, k: usize, x: &DVector<f64>) -> Result<Simulator> {
        let mut simulator = self.experiments[k].simulator.clone();
        let mut parameters = simulator.parameters().clone();
        for setting in &self.settings[k] {
            if let Place::Parameter(name) = &setting.place {
                parameters.set(name, self.value(setting, x))?;
            }
        }
        for (body, root) in self.roots(k, x)? {
            for (name, value) in root::parameters(&body).iter().zip(root::inertia(&root)) {
                parameters.set(name, value)?;
            }
        }
        simulator.set_parameters(parameters)?;
        if self.starts[k].is_some() || self.sets_start(k) {
            let (q, v) = self.initial(k, x);
            simulator.set_start(q, v)?;
        }
        Ok(simulator)
    }

    /// # Errors
    /// The first experiment whose simulation fails, by name.
    pub fn evaluate(&self, x: &DVector<f64>) -> Result<Evaluated> {
        let one = |k: usize| {
            let run = || {
                let simulator = self.simulator(k, x)?;
                let rollout = simulator.rollout(&self.experiments[k].controls)?;
                let differences = self.experiments[k].differences(&rollout)?;
                Ok((differences, rollout))
            };
            run().map_err(|e: Error| e.within(&self.experiments[k].place()))
        };
        let each = in_order((0..self.experiments.len()).into_par_iter().map(one))?;
        let (differences, rollouts): (Vec<DVector<f64>>, Vec<_>) = each.into_iter().unzip();
        let data: f64 = (differences.iter().flat_map(|r| r.iter()))
            .map(|r| self.loss.of(*r).0)
            .sum();
        let known: f64 = (self.priors().iter())
            .map(|(i, p)| ((x[*i] - p.mean) / p.deviation).powi(2))
            .sum();
        Ok(Evaluated {
            x: x.clone(),
            cost: 0.5 * (data + known),
            differences,
            rollouts,
        })
    }
}

/// What unknowns set in an experiment: names that it must have.
fn settings_of(unknowns: &[Searched], experiment: &Experiment) -> Result<Vec<Setting>> {
    let mut out = Vec::new();
    for (i, unknown) in unknowns.iter().enumerate() {
        for (target, factor) in &unknown.sets {
            let (place, scale) = match (target, target.coordinate(&experiment.simulator)?) {
                (_, Some((q, v))) => (Place::Start { q, v }, 1.0),
                (Target::Root { body, entry, .. }, None) => {
                    root::of(&experiment.simulator, body)?;
                    let (body, entry) = (body.clone(), *entry);
                    (Place::Root { body, entry }, 1.0)
                }
                (_, None) => {
                    let name = target.name();
                    experiment.simulator.parameters().get(name)?;
                    let scale = experiment.scales.get(name).copied().unwrap_or(1.0);
                    (Place::Parameter(name.into()), scale)
                }
            };
            out.push(Setting {
                unknown: i,
                factor: scale * factor,
                place,
            });
        }
    }
    Ok(out)
}

/// Generalised velocities that nothing drives.
fn free(simulator: &Simulator) -> Vec<usize> {
    let system = simulator.system();
    let links = system.drives.iter().zip(system.tree.links());
    let free = links.filter(|(drive, _)| **drive == Drive::Free);
    free.flat_map(|(_, link)| link.v.clone()).collect()
}
