//! Scalars of a trajectory and their derivatives with respect to what is observed.

use super::observable::{observable, transpose};
use super::{Cotangents, Gradient, Rollout};
use crate::scene::BodyId;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::ops::Add;

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
}

impl Rollout {
    /// Value of an objective.
    ///
    /// # Errors
    /// An objective that doesn't fit the scene.
    pub fn value(&self, objective: &dyn Objective) -> Result<f64> {
        objective.check(self)?;
        Ok(objective.value(self))
    }

    /// Gradient of an objective, in one reverse sweep.
    ///
    /// # Errors
    /// An objective that doesn't fit the scene, or as [`Rollout::vjp`].
    pub fn gradient(&self, objective: &dyn Objective) -> Result<Gradient> {
        objective.check(self)?;
        self.vjp(&objective.cotangents(self))
    }
}

/// A weighted sum of the terms of this module; add terms with `+`.
#[derive(Clone, Debug, Default)]
pub struct Sum(Vec<Term>);

#[derive(Clone, Debug)]
enum Term {
    Position {
        body: usize,
        target: [f64; 3],
        weight: f64,
        last_only: bool,
    },
    Velocity {
        index: usize,
        target: f64,
        weight: f64,
    },
    Coordinate {
        index: usize,
        target: f64,
        weight: f64,
    },
    Observable {
        name: String,
        entry: usize,
        target: f64,
        weight: f64,
    },
    Effort(f64),
}

impl Add for Sum {
    type Output = Sum;

    fn add(mut self, other: Sum) -> Sum {
        self.0.extend(other.0);
        self
    }
}

/// Squared distance (m²) of a body's origin from `target` (m, world) at the end.
pub fn final_position(body: BodyId, target: [f64; 3]) -> Sum {
    Sum(vec![Term::Position {
        body: body.0,
        target,
        weight: 1.0,
        last_only: true,
    }])
}

/// Mean squared distance (m²) of a body's origin from `target` over all states.
pub fn mean_position(body: BodyId, target: [f64; 3]) -> Sum {
    Sum(vec![Term::Position {
        body: body.0,
        target,
        weight: 1.0,
        last_only: false,
    }])
}

/// `weight · (q_i − target)²` at the end, for a coordinate of a prismatic, revolute or planar joint.
pub fn final_coordinate(index: usize, target: f64, weight: f64) -> Sum {
    Sum(vec![Term::Coordinate {
        index,
        target,
        weight,
    }])
}

/// `weight · (v_i − target)²` at the end.
pub fn final_velocity(index: usize, target: f64, weight: f64) -> Sum {
    Sum(vec![Term::Velocity {
        index,
        target,
        weight,
    }])
}

/// `weight · (x − target)²` at the end, x an entry of an observable that has a transpose ([`super::observable`]), by its name.
pub fn final_observable(name: impl Into<String>, entry: usize, target: f64, weight: f64) -> Sum {
    Sum(vec![Term::Observable {
        name: name.into(),
        entry,
        target,
        weight,
    }])
}

/// `weight` times the sum of squared open-loop controls.
pub fn effort(weight: f64) -> Sum {
    Sum(vec![Term::Effort(weight)])
}

impl Sum {
    /// All terms times `factor`.
    pub fn scaled(mut self, factor: f64) -> Self {
        for term in &mut self.0 {
            match term {
                Term::Position { weight, .. }
                | Term::Velocity { weight, .. }
                | Term::Coordinate { weight, .. }
                | Term::Observable { weight, .. }
                | Term::Effort(weight) => *weight *= factor,
            }
        }
        self
    }
}

/// Tangent index of coordinate `q[index]`, if its joint has plain coordinates.
fn tangent_of(rollout: &Rollout, index: usize) -> Option<usize> {
    let links = rollout.simulator().system().tree.links();
    let link = links.iter().find(|l| l.q.contains(&index))?;
    (link.q.len() == link.v.len()).then(|| link.v.start + index - link.q.start)
}

/// An entry of an observable at the end; a name that none has was refused before.
fn last_entry(rollout: &Rollout, name: &str, entry: usize) -> f64 {
    let at = rollout.states().len() - 1;
    let value = observable(name).and_then(|o| o.value(&rollout.reading(at)));
    value.map_or(f64::NAN, |x| x[entry])
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
            let numbers = match *term {
                Term::Observable {
                    ref name,
                    entry,
                    target,
                    weight,
                } => {
                    // Entries of the value and of its cotangent must be the same ones.
                    let rows: usize = observable(name)?.shape(system).iter().product();
                    if transpose(name)?.tangents(system) != rows {
                        return Err(Error::input(
                            "objective: observable",
                            name,
                            "must have a value whose entries are independent, without quaternions or rotation matrices",
                        ));
                    }
                    below("entry", entry, rows)?;
                    [target, weight, 0.0, 0.0]
                }
                Term::Position {
                    body,
                    target,
                    weight,
                    ..
                } => {
                    below("body", body, system.len())?;
                    [target[0], target[1], target[2], weight]
                }
                Term::Velocity {
                    index,
                    target,
                    weight,
                } => {
                    below("velocity", index, system.tree.velocities())?;
                    [target, weight, 0.0, 0.0]
                }
                Term::Coordinate {
                    index,
                    target,
                    weight,
                } => {
                    below("coordinate", index, system.tree.coordinates())?;
                    if tangent_of(rollout, index).is_none() {
                        return Err(Error::input(
                            "objective: coordinate",
                            index,
                            "must belong to a prismatic, revolute or planar joint; quaternions \
                             have no targets of their own: use a body's position",
                        ));
                    }
                    [target, weight, 0.0, 0.0]
                }
                Term::Effort(weight) => [weight, 0.0, 0.0, 0.0],
            };
            if let Some(bad) = numbers.iter().find(|x| !x.is_finite()) {
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
        let samples = rollout.samples();
        let last = &samples[samples.len() - 1];
        let of = |term: &Term| match *term {
            Term::Position {
                body,
                target,
                weight,
                last_only,
            } => {
                let miss = |s: &super::Sample| {
                    (s.poses[body].translation - nalgebra::Vector3::from(target)).norm_squared()
                };
                if last_only {
                    weight * miss(last)
                } else {
                    weight * samples.iter().map(miss).sum::<f64>() / samples.len() as f64
                }
            }
            Term::Velocity {
                index,
                target,
                weight,
            } => weight * (last.v[index] - target).powi(2),
            Term::Coordinate {
                index,
                target,
                weight,
            } => weight * (last.q[index] - target).powi(2),
            Term::Observable {
                ref name,
                entry,
                target,
                weight,
            } => weight * (last_entry(rollout, name, entry) - target).powi(2),
            Term::Effort(weight) => weight * rollout.controls().norm_squared(),
        };
        self.0.iter().map(of).sum()
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        let samples = rollout.samples();
        let end = samples.len() - 1;
        for term in &self.0 {
            match *term {
                Term::Position {
                    body,
                    target,
                    weight,
                    last_only,
                } => {
                    let (range, scale) = if last_only {
                        (end..end + 1, weight)
                    } else {
                        (0..end + 1, weight / samples.len() as f64)
                    };
                    for n in range {
                        for (k, goal) in target.iter().enumerate() {
                            let miss = samples[n].poses[body].translation[k] - goal;
                            out.positions[(3 * body + k, n)] += 2.0 * scale * miss;
                        }
                    }
                }
                Term::Velocity {
                    index,
                    target,
                    weight,
                } => out.v[(index, end)] += 2.0 * weight * (samples[end].v[index] - target),
                Term::Coordinate {
                    index,
                    target,
                    weight,
                } => {
                    if let Some(i) = tangent_of(rollout, index) {
                        out.q[(i, end)] += 2.0 * weight * (samples[end].q[index] - target);
                    }
                }
                Term::Observable {
                    ref name,
                    entry,
                    target,
                    weight,
                } => {
                    let rows = observable(name).map_or(0, |o| {
                        let system = rollout.simulator().system();
                        o.shape(system).iter().product::<usize>()
                    });
                    let bars = out.observables.entry(name.clone());
                    let bars = bars.or_insert_with(|| DMatrix::zeros(rows, end + 1));
                    let miss = last_entry(rollout, name, entry) - target;
                    bars[(entry, end)] += 2.0 * weight * miss;
                }
                Term::Effort(weight) => out.controls += 2.0 * weight * rollout.controls(),
            }
        }
        out
    }
}
