//! Scalars of a trajectory and their derivatives with respect to what is observed.

use super::observable::{self, differentiable, observable};
use super::part::{Part, Partwise};
use super::{Cotangents, Gradient, Rollout, Sensor};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::ops::{Add, Neg, Range, Sub};

pub use super::which::Which;

/// A scalar function of a rollout.
pub trait Objective {
    /// Whether it fits the rollout's scene; asked before value and derivatives.
    ///
    /// # Errors
    /// What doesn't fit, and what would.
    fn check(&self, _rollout: &Rollout) -> Result<()> {
        Ok(())
    }

    /// Its value.
    fn value(&self, rollout: &Rollout) -> f64;

    /// Its derivatives.
    fn cotangents(&self, rollout: &Rollout) -> Cotangents;

    /// The same, which sweeps ask for, of an objective that may have none at a rollout that has a value.
    ///
    /// # Errors
    /// Why there is none.
    fn try_cotangents(&self, rollout: &Rollout) -> Result<Cotangents> {
        Ok(self.cotangents(rollout))
    }
}

impl Rollout {
    /// Value of an objective.
    ///
    /// # Errors
    /// An objective that doesn't fit the scene, or whose value isn't finite.
    pub fn value(&self, objective: &dyn Objective) -> Result<f64> {
        objective.check(self)?;
        let value = objective.value(self);
        if !value.is_finite() {
            return Err(Error::Unresolved {
                place: "objective".into(),
                quantity: "value".into(),
                value,
                limit: f64::MAX,
                remedy: "it left what floating point holds: take smaller weights or targets".into(),
            });
        }
        Ok(value)
    }

    /// Gradient of an objective, in one reverse sweep.
    ///
    /// # Errors
    /// An objective that doesn't fit the scene, or as [`Rollout::vjp`].
    pub fn gradient(&self, objective: &dyn Objective) -> Result<Gradient> {
        objective.check(self)?;
        self.vjp(&objective.try_cotangents(self)?)
    }
}

/// A weighted sum of the terms of this module; add and subtract terms with `+` and `-`.
#[derive(Clone, Debug, Default)]
pub struct Sum(Vec<Term>);

/// `weight` times the squared distance of some numbers from `target`: at the end, or its mean over all states.
#[derive(Clone, Debug)]
struct Term {
    of: Of,
    target: Vec<f64>,
    weight: f64,
    last_only: bool,
    /// Of how many states, the first ones, and over how many the mean is; all where it doesn't say.
    own: Option<(usize, usize)>,
}

/// Numbers of a term, as many as its target has.
#[derive(Clone, Debug)]
enum Of {
    /// Position of a body.
    Body(Which),
    /// Of v, from this index.
    Velocity(usize),
    /// Of q.
    Coordinate(usize),
    /// Of an observable by its name.
    Observable(String, usize),
    /// Velocity of the water at a sensor.
    Flow(Sensor),
    /// Pressure of the flow at a sensor.
    Pressure(Sensor),
    /// All open-loop controls, against zero.
    Controls,
    /// All controls that acted, against zero.
    AppliedControls,
}

impl Add for Sum {
    type Output = Sum;

    fn add(mut self, other: Sum) -> Sum {
        self.0.extend(other.0);
        self
    }
}

impl Neg for Sum {
    type Output = Sum;

    fn neg(self) -> Sum {
        self.scaled(-1.0)
    }
}

impl Sub for Sum {
    type Output = Sum;

    fn sub(self, other: Sum) -> Sum {
        self + -other
    }
}

fn at_end(of: Of, target: &[f64], weight: f64) -> Sum {
    Sum(vec![Term {
        of,
        target: target.into(),
        weight,
        last_only: true,
        own: None,
    }])
}

/// Squared distance (m²) of a body's origin from `target` (m, world) at the end.
pub fn final_position(body: impl Into<Which>, target: [f64; 3]) -> Sum {
    at_end(Of::Body(body.into()), &target, 1.0)
}

/// Mean squared distance (m²) of a body's origin from `target` over all states.
pub fn mean_position(body: impl Into<Which>, target: [f64; 3]) -> Sum {
    let mut out = final_position(body, target);
    out.0[0].last_only = false;
    out
}

/// `weight · (q_i − target)²` at the end, for a coordinate of a prismatic, revolute or planar joint.
pub fn final_coordinate(index: usize, target: f64, weight: f64) -> Sum {
    at_end(Of::Coordinate(index), &[target], weight)
}

/// `weight · (v_i − target)²` at the end.
pub fn final_velocity(index: usize, target: f64, weight: f64) -> Sum {
    at_end(Of::Velocity(index), &[target], weight)
}

/// `weight · (x − target)²` at the end, x an entry of an observable that has derivatives ([`super::observable`]), by its name.
pub fn final_observable(name: impl Into<String>, entry: usize, target: f64, weight: f64) -> Sum {
    at_end(Of::Observable(name.into(), entry), &[target], weight)
}

/// The mean of `weight · (x − target)²` over all states, x as in [`final_observable`].
pub fn mean_observable(name: impl Into<String>, entry: usize, target: f64, weight: f64) -> Sum {
    let mut out = final_observable(name, entry, target, weight);
    out.0[0].last_only = false;
    out
}

/// `weight` times the squared distance of the water's velocity at a sensor ([`Rollout::sensor_flow`]) from `target` (m/s, world axes) at the end.
pub fn final_flow(sensor: Sensor, target: [f64; 3], weight: f64) -> Sum {
    at_end(Of::Flow(sensor), &target, weight)
}

/// The mean of the same over all states.
pub fn mean_flow(sensor: Sensor, target: [f64; 3], weight: f64) -> Sum {
    let mut out = final_flow(sensor, target, weight);
    out.0[0].last_only = false;
    out
}

/// `weight · (p − target)²` at the end, p the flow's pressure at a sensor ([`Rollout::sensor_pressure`]), Pa.
pub fn final_pressure(sensor: Sensor, target: f64, weight: f64) -> Sum {
    at_end(Of::Pressure(sensor), &[target], weight)
}

/// The mean of the same over all states.
pub fn mean_pressure(sensor: Sensor, target: f64, weight: f64) -> Sum {
    let mut out = final_pressure(sensor, target, weight);
    out.0[0].last_only = false;
    out
}

/// `weight` times the sum of squared open-loop controls.
pub fn effort(weight: f64) -> Sum {
    at_end(Of::Controls, &[], weight)
}

/// `weight` times the sum of the squares of the controls that acted: the open-loop ones and what the controller added, so that its gains have a share in it.
pub fn applied_effort(weight: f64) -> Sum {
    at_end(Of::AppliedControls, &[], weight)
}

impl Sum {
    /// All terms times `factor`.
    pub fn scaled(mut self, factor: f64) -> Self {
        for term in &mut self.0 {
            term.weight *= factor;
        }
        self
    }
}

impl Of {
    /// Whether it is of steps, not of states.
    fn is_of_controls(&self) -> bool {
        matches!(self, Self::Controls | Self::AppliedControls)
    }
}

impl Sum {
    /// Its terms as far as a part of a run has them, to be taken of the part alone.
    fn of_part(&self, part: &Part) -> Self {
        let here = |term: &&Term| term.of.is_of_controls() || !term.last_only || part.is_last();
        let terms = self.0.iter().filter(here).map(|term| Term {
            own: Some((part.states().len(), part.steps + 1)),
            ..term.clone()
        });
        Self(terms.collect())
    }
}

impl Partwise for Sum {
    fn part(&self, part: &Part) -> Result<(f64, Cotangents)> {
        let own = self.of_part(part);
        let value = part.rollout.value(&own)?;
        Ok((value, own.try_cotangents(part.rollout)?))
    }
}

/// Tangent index of coordinate `q[index]`, if its joint has plain coordinates.
fn tangent_of(rollout: &Rollout, index: usize) -> Option<usize> {
    observable::tangent_of("q", rollout.simulator().system(), index).ok()?
}

impl Term {
    /// States at which it is taken.
    fn states(&self, rollout: &Rollout) -> Range<usize> {
        let end = rollout.states().len();
        match (self.last_only, self.own) {
            (true, _) => end - 1..end,
            (false, Some((own, _))) => 0..own,
            (false, None) => 0..end,
        }
    }

    /// Number of states over which it is a mean.
    fn count(&self, rollout: &Rollout) -> f64 {
        let here = self.states(rollout).len();
        let count = match self.last_only {
            true => here,
            false => self.own.map_or(here, |(_, all)| all),
        };
        count as f64
    }

    /// What its numbers miss the target by at state `n`; a name that no observable has was refused before.
    fn misses(&self, rollout: &Rollout, n: usize) -> Vec<f64> {
        let (name, from) = match &self.of {
            Of::Body(body) => match body.number(rollout) {
                Some(body) => ("positions", 3 * body),
                None => return vec![f64::NAN; self.target.len()],
            },
            Of::Velocity(index) => ("v", *index),
            Of::Coordinate(index) => ("q", *index),
            Of::Observable(name, entry) => (name.as_str(), *entry),
            Of::Flow(_) | Of::Pressure(_) => {
                let found = self.sensed(rollout, n);
                let found = found.unwrap_or_else(|_| vec![f64::NAN; self.target.len()]);
                return found
                    .iter()
                    .zip(&self.target)
                    .map(|(x, goal)| x - goal)
                    .collect();
            }
            Of::Controls | Of::AppliedControls => return Vec::new(),
        };
        let found = observable(name).and_then(|o| Ok((o, o.value(&rollout.reading(n))?)));
        let miss = |(k, goal): (usize, &f64)| match &found {
            Ok((observable, value)) => observable.miss(value[from + k], *goal),
            Err(_) => f64::NAN,
        };
        self.target.iter().enumerate().map(miss).collect()
    }

    /// What its sensor reads at state `n`; nothing of what has none.
    fn sensed(&self, rollout: &Rollout, n: usize) -> Result<Vec<f64>> {
        match &self.of {
            Of::Flow(sensor) => {
                let found = rollout.sensor_flow(n, std::slice::from_ref(sensor))?;
                Ok(found.iter().flat_map(|u| [u.x, u.y, u.z]).collect())
            }
            Of::Pressure(sensor) => rollout.sensor_pressure(n, std::slice::from_ref(sensor)),
            _ => Ok(Vec::new()),
        }
    }

    /// The cotangents of what its sensor reads, one column a state; none of what has none.
    fn sensed_cotangents(&self, rollout: &Rollout, scale: f64) -> Option<Result<Cotangents>> {
        let (sensor, rows) = match &self.of {
            Of::Flow(sensor) => (sensor, 3),
            Of::Pressure(sensor) => (sensor, 1),
            _ => return None,
        };
        let mut bars = DMatrix::zeros(rows, rollout.states().len());
        for n in self.states(rollout) {
            for (k, miss) in self.misses(rollout, n).into_iter().enumerate() {
                bars[(k, n)] = 2.0 * scale * miss;
            }
        }
        let sensors = std::slice::from_ref(sensor);
        Some(match rows {
            1 => rollout.sensor_vjp(sensors, None, Some(&bars)),
            _ => rollout.sensor_vjp(sensors, Some(&bars), None),
        })
    }
}

impl Objective for Sum {
    fn check(&self, rollout: &Rollout) -> Result<()> {
        let system = rollout.simulator().system();
        let below = |what: &str, index: usize, limit: usize| {
            if index < limit {
                return Ok(());
            }
            Err(Error::input(
                format!("objective: {what}"),
                index,
                format!("must be under {limit}, the scene's number of them"),
            ))
        };
        for term in &self.0 {
            match &term.of {
                Of::Observable(name, entry) => {
                    // Entries of the value and of its cotangent must be the same ones.
                    let rows: usize = observable(name)?.shape(system).iter().product();
                    let found = differentiable(name)?;
                    rollout.reads(name, found)?;
                    below("entry", *entry, rows)?;
                    if observable::tangent_of(name, system, *entry)?.is_none() {
                        return Err(Error::input(
                            "objective: observable",
                            format!("entry {entry} of {name}"),
                            "must be independent of the other entries, no part of the place of a joint that turns in three dimensions or of a rotation matrix",
                        ));
                    }
                }
                Of::Body(body) => drop(body.found("objective", rollout)?),
                Of::Flow(_) | Of::Pressure(_) => {
                    for n in term.states(rollout) {
                        term.sensed(rollout, n)?;
                    }
                }
                Of::Velocity(index) => below("velocity", *index, system.tree.velocities())?,
                Of::Coordinate(index) => {
                    below("coordinate", *index, system.tree.coordinates())?;
                    if tangent_of(rollout, *index).is_none() {
                        return Err(Error::input(
                            "objective: coordinate",
                            index,
                            "must belong to a prismatic, revolute or planar joint; quaternions \
                             have no targets of their own: use a body's position",
                        ));
                    }
                }
                Of::Controls | Of::AppliedControls => {}
            }
            let mut numbers = term.target.iter().chain([&term.weight]);
            if let Some(bad) = numbers.find(|x| !x.is_finite()) {
                return Err(Error::input(
                    "objective: target or weight",
                    bad,
                    "must be finite",
                ));
            }
        }
        Ok(())
    }

    fn value(&self, rollout: &Rollout) -> f64 {
        let of = |term: &Term| {
            match term.of {
                Of::Controls => return term.weight * rollout.controls().norm_squared(),
                Of::AppliedControls => {
                    return term.weight * rollout.applied_controls().norm_squared();
                }
                _ => {}
            }
            let states = term.states(rollout);
            let count = term.count(rollout);
            let squares = |n| term.misses(rollout, n).iter().map(|x| x * x).sum::<f64>();
            term.weight * states.map(squares).sum::<f64>() / count
        };
        self.0.iter().map(of).sum()
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        // Not a number is refused by the sweep.
        self.try_cotangents(rollout).unwrap_or_else(|_| {
            let mut out = rollout.zero_cotangents();
            out.density = f64::NAN;
            out
        })
    }

    fn try_cotangents(&self, rollout: &Rollout) -> Result<Cotangents> {
        let mut out = rollout.zero_cotangents();
        let columns = rollout.states().len();
        for term in &self.0 {
            let scale = term.weight / term.count(rollout);
            if let Some(sensed) = term.sensed_cotangents(rollout, scale) {
                out.add(&sensed?);
                continue;
            }
            let (bars, from) = match &term.of {
                Of::Body(body) => match body.number(rollout) {
                    Some(body) => (&mut out.positions, 3 * body),
                    None => continue,
                },
                Of::Velocity(index) => (&mut out.v, *index),
                Of::Coordinate(index) => match tangent_of(rollout, *index) {
                    Some(index) => (&mut out.q, index),
                    None => continue,
                },
                Of::Observable(name, entry) => {
                    let system = rollout.simulator().system();
                    let rows = differentiable(name).map_or(0, |t| t.tangents(system));
                    let bars = out.observables.entry(name.clone());
                    let bars = bars.or_insert_with(|| DMatrix::zeros(rows, columns));
                    let own = observable::tangent_of(name, system, *entry);
                    let Ok(Some(entry)) = own else { continue };
                    (bars, entry)
                }
                Of::Controls => {
                    out.controls += 2.0 * term.weight * rollout.controls();
                    continue;
                }
                Of::AppliedControls => {
                    out.applied_controls += 2.0 * term.weight * rollout.applied_controls();
                    continue;
                }
                Of::Flow(_) | Of::Pressure(_) => continue,
            };
            let states = term.states(rollout);
            for n in states {
                for (k, miss) in term.misses(rollout, n).into_iter().enumerate() {
                    bars[(from + k, n)] += 2.0 * scale * miss;
                }
            }
        }
        Ok(out)
    }
}
