//! Terms as a user writes them.

use super::bound::BoundTerm;
use super::motion::{Configuration, Frame, Observed, Orientation, Position, Velocity};
use super::{CustomCost, Target};
use crate::simulate::Simulator;
use crate::{Error, Result};
use nalgebra::DVector;
use std::sync::Arc;

/// Weights of squares: one for all entries, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights(Vec<f64>);

impl From<f64> for Weights {
    fn from(all: f64) -> Self {
        Self(vec![all])
    }
}

impl From<Vec<f64>> for Weights {
    fn from(each: Vec<f64>) -> Self {
        Self(each)
    }
}

impl<const N: usize> From<[f64; N]> for Weights {
    fn from(each: [f64; N]) -> Self {
        Self(each.into())
    }
}

impl Weights {
    /// One for each of so many entries.
    fn each(&self, place: &str, entries: usize) -> Result<DVector<f64>> {
        let refuse = |expected: String| {
            let place = format!("{place}: weights");
            Err(Error::input(place, format!("{:?}", self.0), expected))
        };
        if self.0.iter().any(|w| !(*w >= 0.0 && w.is_finite())) {
            return refuse("must be finite and not negative".into());
        }
        match self.0.as_slice() {
            [all] => Ok(DVector::from_element(entries, *all)),
            each if each.len() == entries => Ok(DVector::from_column_slice(each)),
            _ => refuse(format!(
                "must be one number, or {entries}, one for each entry"
            )),
        }
    }
}

/// One term of a [`Cost`](super::Cost); made by the functions of [`terms`].
#[derive(Clone)]
pub struct Term {
    of: Of,
    target: Target,
    weights: Weights,
}

#[derive(Clone)]
enum Of {
    Configuration,
    Velocity,
    /// About zero where no target is given.
    Control(bool),
    Change,
    Position(String, [f64; 3]),
    Orientation(String),
    Observable(String, Vec<usize>),
    Custom(Arc<dyn CustomCost>),
}

/// Terms of a cost; see [`crate::optimize::Cost`]. Units of weights: one over the square of the entry's, and over s in a running term.
pub mod terms {
    use super::{Arc, CustomCost, Of, Target, Term, Weights};

    fn term(of: Of, target: impl Into<Target>, weights: impl Into<Weights>) -> Term {
        Term {
            of,
            target: target.into(),
            weights: weights.into(),
        }
    }

    /// Distance of all coordinates from `target` (nq, unit quaternions as in q; m, rad), in their tangent space: a weight for each of nv entries, or one.
    pub fn configuration(target: impl Into<Target>, weights: impl Into<Weights>) -> Term {
        term(Of::Configuration, target, weights)
    }

    /// Distance of the generalised velocity from `target` (nv; m/s, rad/s).
    pub fn velocity(target: impl Into<Target>, weights: impl Into<Weights>) -> Term {
        term(Of::Velocity, target, weights)
    }

    /// The open-loop controls (N, N m).
    pub fn effort(weights: impl Into<Weights>) -> Term {
        term(Of::Control(false), Target::fixed([]), weights)
    }

    /// Distance of the open-loop controls from `target`, one number each.
    pub fn control(target: impl Into<Target>, weights: impl Into<Weights>) -> Term {
        term(Of::Control(true), target, weights)
    }

    /// Change of each open-loop control from one knot to the next. At the first knot it counts from
    /// [`Problem::previous`](crate::optimize::Problem::previous), or not at all.
    pub fn control_change(weights: impl Into<Weights>) -> Term {
        term(Of::Change, Target::fixed([]), weights)
    }

    /// Distance of the origin of a body or site from `target` (m, world axes).
    pub fn position(
        frame: impl Into<String>,
        target: impl Into<Target>,
        weights: impl Into<Weights>,
    ) -> Term {
        point(frame, [0.0; 3], target, weights)
    }

    /// Distance of a point of a body or site (m, its frame) from `target` (m, world axes).
    pub fn point(
        frame: impl Into<String>,
        point: [f64; 3],
        target: impl Into<Target>,
        weights: impl Into<Weights>,
    ) -> Term {
        term(Of::Position(frame.into(), point), target, weights)
    }

    /// Rotation vector (rad, world axes) that takes the axes of a body or site from `target`, a rotation vector from the world's axes, to where they are.
    pub fn orientation(
        frame: impl Into<String>,
        target: impl Into<Target>,
        weights: impl Into<Weights>,
    ) -> Term {
        term(Of::Orientation(frame.into()), target, weights)
    }

    /// Distance of entries of an observable with derivatives ([`crate::simulate::observable`]), by its name, from `target`, one number each.
    pub fn observable(
        name: impl Into<String>,
        entries: impl Into<Vec<usize>>,
        target: impl Into<Target>,
        weights: impl Into<Weights>,
    ) -> Term {
        term(Of::Observable(name.into(), entries.into()), target, weights)
    }

    /// A cost of one's own.
    pub fn custom(cost: impl CustomCost + 'static) -> Term {
        term(Of::Custom(Arc::new(cost)), Target::fixed([]), 1.0)
    }
}

impl Term {
    /// What it is of.
    pub(super) fn name(&self) -> String {
        match &self.of {
            Of::Configuration => "configuration".into(),
            Of::Velocity => "velocity".into(),
            Of::Control(false) => "effort".into(),
            Of::Control(true) => "control".into(),
            Of::Change => "control_change".into(),
            Of::Position(frame, _) => format!("position of {frame:?}"),
            Of::Orientation(frame) => format!("orientation of {frame:?}"),
            Of::Observable(name, _) => format!("observable {name:?}"),
            Of::Custom(_) => "custom".into(),
        }
    }

    pub(super) fn bind(&self, simulator: &Simulator, place: &str, last: bool) -> Result<BoundTerm> {
        let system = simulator.system();
        let (nv, nu) = (system.tree.velocities(), system.controls);
        let target = |length: usize| -> Result<Target> {
            self.target.check(place, length)?;
            Ok(self.target.clone())
        };
        let weights = |entries: usize| self.weights.each(place, entries);
        if last && matches!(self.of, Of::Control(_) | Of::Change) {
            return Err(Error::input(
                place,
                "a last term",
                "must be a running term: no control acts at the end",
            ));
        }
        Ok(match &self.of {
            Of::Configuration => {
                let nq = system.tree.coordinates();
                for row in target(nq)?.rows() {
                    let q = DVector::from_column_slice(row);
                    simulator
                        .integrate(&q, &DVector::zeros(nv))
                        .map_err(|e| match e {
                            Error::Input {
                                place: what,
                                value,
                                expected,
                            } => Error::input(format!("{place}: target: {what}"), value, expected),
                            other => other,
                        })?;
                }
                let goal = Configuration(target(nq)?);
                BoundTerm::Squares(Box::new(goal), weights(nv)?)
            }
            Of::Velocity => BoundTerm::Squares(Box::new(Velocity(target(nv)?)), weights(nv)?),
            Of::Control(false) => BoundTerm::Control(Target::fixed(vec![0.0; nu]), weights(nu)?),
            Of::Control(true) => BoundTerm::Control(target(nu)?, weights(nu)?),
            Of::Change => BoundTerm::Change(weights(nu)?),
            Of::Position(frame, point) => {
                if let Some(bad) = point.iter().find(|x| !x.is_finite()) {
                    return Err(Error::input(
                        format!("{place}: point"),
                        bad,
                        "must be finite",
                    ));
                }
                let frame = Frame::named(simulator, place, frame)?.at(point);
                let goal = Position(frame, target(3)?);
                BoundTerm::Squares(Box::new(goal), weights(3)?)
            }
            Of::Orientation(frame) => {
                let goal = Orientation(Frame::named(simulator, place, frame)?, target(3)?);
                BoundTerm::Squares(Box::new(goal), weights(3)?)
            }
            Of::Observable(name, entries) => {
                let goal = Observed {
                    name: name.clone(),
                    entries: entries.clone(),
                    target: target(entries.len())?,
                };
                goal.check(simulator, place)?;
                BoundTerm::Squares(Box::new(goal), weights(entries.len())?)
            }
            Of::Custom(cost) => BoundTerm::Custom(cost.clone()),
        })
    }
}
