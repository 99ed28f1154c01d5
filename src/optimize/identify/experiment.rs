//! One recording, and what is simulated in its place.

use crate::simulate::observable::{differentiable, observable};
use crate::simulate::{Controls, Rollout, Simulator};
use crate::{Error, Result};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// Observables that are angles: differences of theirs are taken the shorter way.
const ANGLES: [&str; 2] = ["attitudes", "site_attitudes"];

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
        }
    }

    /// Adds what was seen.
    pub fn saw(mut self, recorded: Recorded) -> Self {
        self.recorded.push(recorded);
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

    /// Number of residuals.
    pub(super) fn residuals(&self) -> usize {
        self.recorded.iter().map(|r| r.states.len()).sum()
    }

    /// Refuses what doesn't fit.
    pub(super) fn check(&self) -> Result<()> {
        let place = |of: &str| format!("experiment {:?}: {of}", self.name);
        if self.residuals() == 0 {
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
        for r in &self.recorded {
            let place = |field: &str| place(&format!("{:?}: {field}", r.observable));
            let system = self.simulator.system();
            let entries = differentiable(&r.observable)?.tangents(system);
            let values: usize = observable(&r.observable)?.shape(system).iter().product();
            if values != entries {
                return Err(Error::input(
                    place("observable"),
                    format!("{values} entries that move in {entries} directions"),
                    "its entries can't be compared one by one: take \"positions\" and \"attitudes\"",
                ));
            }
            if r.entry >= entries {
                let remedy = format!("must be under {entries}, counted from 0");
                return Err(Error::input(place("entry"), r.entry, remedy));
            }
            if r.states.len() != r.values.len() {
                return Err(Error::input(
                    place("values"),
                    format!("{} of them", r.values.len()),
                    format!("must be as many as states, {}", r.states.len()),
                ));
            }
            if let Some(n) = r.states.iter().find(|n| **n > steps) {
                let remedy = format!("must be at most {steps}, the last state");
                return Err(Error::input(place("states"), n, remedy));
            }
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

    /// Simulated less recorded, in deviations.
    pub(super) fn differences(&self, rollout: &Rollout) -> Result<DVector<f64>> {
        let mut out = Vec::with_capacity(self.residuals());
        for r in &self.recorded {
            for (n, seen) in r.states.iter().zip(&r.values) {
                let simulated = rollout.observable_value(&r.observable, *n)?[r.entry];
                let mut off = simulated - seen;
                if ANGLES.contains(&r.observable.as_str()) {
                    off -= TAU * (off / TAU).round();
                }
                out.push(off / r.deviation);
            }
        }
        Ok(out.into())
    }
}
