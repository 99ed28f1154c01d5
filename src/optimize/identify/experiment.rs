//! One recording, and what is simulated in its place.

use super::derived::Derived;
use crate::simulate::observable::{differentiable, observable, tangent_of};
use crate::simulate::{Controls, Rollout, Simulator};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

/// One entry of an observable as it was seen at some states of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Name of the observable.
    pub observable: String,
    /// The entry, counted from 0, last index fastest: `3 * body + 1` is a body's pitch among "attitudes", its y among "positions".
    pub entry: usize,
    /// Numbers of the states at which it was seen.
    pub states: Vec<usize>,
    /// What was seen there, in the observable's unit.
    pub values: Vec<f64>,
    /// Standard deviation of the noise.
    pub deviation: f64,
}

/// A recording: what was done, and what was seen.
#[derive(Clone)]
pub struct Experiment {
    pub(super) name: String,
    pub(super) simulator: Simulator,
    pub(super) controls: Controls,
    pub(super) recorded: Vec<Recorded>,
    /// Deviations of the initial coordinates and velocity, where they are unknown.
    pub(super) start: Option<[f64; 2]>,
    pub(super) derived: Vec<Derived>,
    /// What parameters are here of what unknowns set them to.
    pub(super) scales: BTreeMap<String, f64>,
}

impl Experiment {
    /// Of a simulator that starts where the recording does ([`Simulator::set_start`]), with the controls that were given. Parameters that aren't unknown are the simulator's.
    pub fn new(name: impl Into<String>, simulator: Simulator, controls: Controls) -> Self {
        Self {
            name: name.into(),
            simulator,
            controls,
            recorded: Vec::new(),
            start: None,
            derived: Vec::new(),
            scales: BTreeMap::new(),
        }
    }

    /// Adds what was seen.
    pub fn saw(mut self, recorded: Recorded) -> Self {
        self.recorded.push(recorded);
        self
    }

    /// Adds residuals that are a function of whole observables at some states (amplitudes, phases, mean speeds): `function` gets each as entries × states, in the order of the names, and gives
    /// differences from what was measured, over their deviations. It must be differentiable: it is differentiated by differences of its own, along exact tangents of the observables.
    pub fn saw_function(
        mut self,
        observables: &[&str],
        states: Vec<usize>,
        function: impl Fn(&[DMatrix<f64>]) -> Result<DVector<f64>> + Send + Sync + 'static,
    ) -> Self {
        let names = observables.iter().map(|name| (*name).to_string());
        let of = Derived::new(names.collect(), states, Arc::new(function));
        self.derived.push(of);
        self
    }

    /// Makes a parameter `factor` times what an unknown sets it to, in this experiment: where a law says how it depends on what was done. Starts and roots of inertias aren't scaled.
    pub fn scaled(mut self, parameter: impl Into<String>, factor: f64) -> Self {
        self.scales.insert(parameter.into(), factor);
        self
    }

    /// Makes the initial state unknown: known beforehand to the deviations `q` (m or rad, 0: exactly) and `v` (m/s or rad/s, 0: exactly), each coordinate alike.
    pub fn start_within(mut self, q: f64, v: f64) -> Self {
        self.start = Some([q, v]);
        self
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The simulator.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// Number of residuals that are entries of observables.
    pub(super) fn residuals(&self) -> usize {
        self.recorded.iter().map(|r| r.states.len()).sum()
    }

    /// What messages call it.
    pub(super) fn place(&self) -> String {
        format!("experiment {:?}", self.name)
    }

    /// Refuses what doesn't fit; `set` are the names of the parameters that unknowns set.
    pub(super) fn check(&self, set: &BTreeSet<&str>) -> Result<()> {
        let place = |of: &str| format!("{}: {of}", self.place());
        if self.residuals() == 0 && self.derived.is_empty() {
            let remedy = "add what was seen (`saw`)";
            return Err(Error::input(place("recorded"), "nothing", remedy));
        }
        for given in self.start.into_iter().flatten() {
            if !(given >= 0.0 && given.is_finite()) {
                let remedy = "give deviations that are zero or positive";
                return Err(Error::input(place("start_within"), given, remedy));
            }
        }
        let steps = self.controls.steps();
        for (name, factor) in &self.scales {
            if !set.contains(name.as_str()) {
                let remedy = format!(
                    "no unknown sets a parameter of this name: give the simulator the value itself; scaled are parameters that unknowns set, {set:?}, not starts or roots of inertias"
                );
                return Err(Error::input(place("scale"), format!("{name:?}"), remedy));
            }
            if !factor.is_finite() {
                let place = place(&format!("scale of {name:?}"));
                return Err(Error::input(place, factor, "must be finite"));
            }
        }
        for of in &self.derived {
            let place = |field: &str| place(&format!("function of {:?}: {field}", of.observables));
            for name in &of.observables {
                self.entries(name)
                    .map_err(|e| e.within(&place("observable")))?;
            }
            check_states(&of.states, steps, &place)?;
            if of.states.is_empty() || of.observables.is_empty() {
                let remedy = "give at least one state and one observable";
                return Err(Error::input(place("states"), "none", remedy));
            }
        }
        for r in &self.recorded {
            let place = |field: &str| place(&format!("{:?}: {field}", r.observable));
            let entries = self.values(&r.observable);
            let entries = entries.map_err(|e| e.within(&place("observable")))?;
            if r.entry >= entries {
                let remedy = format!("must be under {entries}, counted from 0");
                return Err(Error::input(place("entry"), r.entry, remedy));
            }
            if self.tangent_of(r)?.is_none() {
                let remedy = "must be an entry that moves by itself, no part of the place of a joint that turns in three dimensions: take \"positions\" and \"attitudes\" for those";
                return Err(Error::input(place("entry"), r.entry, remedy));
            }
            if r.states.len() != r.values.len() {
                return Err(Error::input(
                    place("values"),
                    format!("{} of them", r.values.len()),
                    format!("must be as many as states, {}", r.states.len()),
                ));
            }
            check_states(&r.states, steps, &place)?;
            if let Some(x) = r.values.iter().find(|x| !x.is_finite()) {
                let remedy = "must be finite: leave states out at which nothing was seen";
                return Err(Error::input(place("values"), x, remedy));
            }
            if !(r.deviation > 0.0 && r.deviation.is_finite()) {
                let remedy = "must be a positive number, in the observable's unit";
                return Err(Error::input(place("deviation"), r.deviation, remedy));
            }
        }
        Ok(())
    }

    /// Number of entries of an observable with derivatives.
    fn values(&self, name: &str) -> Result<usize> {
        differentiable(name)?;
        let shape = observable(name)?.shape(self.simulator.system());
        Ok(shape.iter().product())
    }

    /// The tangent of the observable by which what was recorded moves.
    pub(super) fn tangent_of(&self, recorded: &Recorded) -> Result<Option<usize>> {
        tangent_of(
            &recorded.observable,
            self.simulator.system(),
            recorded.entry,
        )
    }

    /// Number of entries of an observable, each of which moves by a tangent of its own.
    fn entries(&self, name: &str) -> Result<usize> {
        let system = self.simulator.system();
        let entries = differentiable(name)?.tangents(system);
        let values = self.values(name)?;
        match values == entries {
            true => Ok(entries),
            false => Err(Error::input(
                format!("{name:?}"),
                format!("{values} entries that move in {entries} directions"),
                "its entries can't be compared one by one: take \"positions\" and \"attitudes\"",
            )),
        }
    }

    /// Simulated less recorded, in deviations.
    pub(super) fn differences(&self, rollout: &Rollout) -> Result<DVector<f64>> {
        let mut out = Vec::with_capacity(self.residuals());
        // Entries of one observable are mostly seen at the same states.
        let mut found: HashMap<(&str, usize), Vec<f64>> = HashMap::new();
        for r in &self.recorded {
            let name = r.observable.as_str();
            let seen_as = observable(name)?;
            for (n, seen) in r.states.iter().zip(&r.values) {
                let values = match found.entry((name, *n)) {
                    Entry::Occupied(held) => held.into_mut(),
                    Entry::Vacant(free) => free.insert(rollout.observable_value(name, *n)?),
                };
                let off = seen_as.miss(values[r.entry], *seen);
                out.push(off / r.deviation);
            }
        }
        for of in &self.derived {
            out.extend(of.value(&of.seen(rollout)?)?.iter());
        }
        Ok(out.into())
    }
}

fn check_states(states: &[usize], steps: usize, place: &dyn Fn(&str) -> String) -> Result<()> {
    match states.iter().find(|n| **n > steps) {
        None => Ok(()),
        Some(n) => {
            let remedy = format!("must be at most {steps}, the last state");
            Err(Error::input(place("states"), n, remedy))
        }
    }
}
