//! A cost made ready for a simulator.

use super::motion::Residual;
use super::{CostPoint, CustomCost, Quadratic, Target};
use crate::simulate::Simulator;
use crate::{Error, Result};
use nalgebra::DVector;
use std::fmt;
use std::sync::Arc;

/// Numbers of a simulator that a cost is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::optimize) struct Sizes {
    /// nq.
    pub coordinates: usize,
    /// nv.
    pub velocities: usize,
    pub controls: usize,
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (q, v, u) = (self.coordinates, self.velocities, self.controls);
        write!(f, "{q} coordinates, {v} velocities and {u} controls")
    }
}

impl Sizes {
    pub fn of(simulator: &Simulator) -> Self {
        let system = simulator.system();
        Self {
            coordinates: system.tree.coordinates(),
            velocities: system.tree.velocities(),
            controls: system.controls,
        }
    }

    /// Numbers of a state, 2nv.
    pub fn states(&self) -> usize {
        2 * self.velocities
    }
}

/// A term with everything looked up.
pub(super) enum BoundTerm {
    /// Squares of a residual with their weights.
    Squares(Box<dyn Residual>, DVector<f64>),
    /// Of controls about a target.
    Control(Target, DVector<f64>),
    /// Of changes of controls: no part of [`Quadratic`], since it is of two knots.
    Change(DVector<f64>),
    Custom(Arc<dyn CustomCost>),
}

impl BoundTerm {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        let squares = |r: &DVector<f64>, w: &DVector<f64>| {
            r.iter().zip(w).map(|(r, w)| w * r * r).sum::<f64>()
        };
        Ok(match self {
            Self::Squares(residual, weights) => squares(&residual.value(at)?, weights),
            Self::Control(target, weights) => {
                control_miss(at, target).map_or(0.0, |miss| squares(&miss, weights))
            }
            Self::Change(weights) => match (at.control, at.previous) {
                (Some(now), Some(before)) => squares(&(now - before), weights),
                _ => 0.0,
            },
            Self::Custom(cost) => cost.value(at)?,
        })
    }

    /// Adds `scale` times the value and its derivatives; of changes of controls nothing.
    fn add(&self, at: &CostPoint, scale: f64, out: &mut Quadratic) -> Result<()> {
        match self {
            Self::Squares(residual, weights) => {
                let (r, jacobian) = residual.jacobian(at)?;
                let mut weighted = jacobian.clone();
                for (mut row, w) in weighted.row_iter_mut().zip(weights) {
                    row *= 2.0 * scale * w;
                }
                out.value += scale * r.component_mul(weights).dot(&r);
                out.x += weighted.tr_mul(&r);
                out.xx += weighted.tr_mul(&jacobian);
            }
            Self::Control(target, weights) => {
                if let Some(miss) = control_miss(at, target) {
                    for (i, (miss, w)) in miss.iter().zip(weights).enumerate() {
                        out.value += scale * w * miss * miss;
                        out.u[i] += 2.0 * scale * w * miss;
                        out.uu[(i, i)] += 2.0 * scale * w;
                    }
                }
            }
            Self::Change(_) => {}
            Self::Custom(cost) => {
                let own = cost.quadratic(at)?;
                for ((name, shape, _), (_, right, _)) in own.parts().iter().zip(out.parts()) {
                    if *shape != right {
                        return Err(Error::input(
                            format!("custom cost at knot {}: {name}", at.knot),
                            format!("{shape:?}"),
                            format!("must have the shape {right:?}"),
                        ));
                    }
                }
                out.add_scaled(scale, &own);
            }
        }
        Ok(())
    }
}

fn control_miss(at: &CostPoint, target: &Target) -> Option<DVector<f64>> {
    let mut goal = target.plain(at.sample().time);
    let u = at.control?;
    Some(u.map(|u| u - goal.next().unwrap_or(0.0)))
}

/// A cost made ready for a simulator.
pub(in crate::optimize) struct Bound {
    pub sizes: Sizes,
    running: Vec<BoundTerm>,
    last: Vec<BoundTerm>,
    /// Weights of changes of controls, all such terms together; none where there are none.
    pub change: Option<DVector<f64>>,
}

impl Bound {
    pub(super) fn new(sizes: Sizes, running: Vec<BoundTerm>, last: Vec<BoundTerm>) -> Self {
        let mut change: Option<DVector<f64>> = None;
        for term in &running {
            if let BoundTerm::Change(weights) = term {
                change = Some(change.map_or(weights.clone(), |sum| sum + weights));
            }
        }
        Self {
            sizes,
            running,
            last,
            change,
        }
    }

    /// Terms at a point: those that run where a control acts.
    fn terms(&self, at: &CostPoint) -> &[BoundTerm] {
        match at.control {
            Some(_) => &self.running,
            None => &self.last,
        }
    }

    /// Value at a knot: of running terms what `duration` (s) of them costs; of last ones themselves, at the end.
    pub fn value(&self, at: &CostPoint, duration: f64) -> Result<f64> {
        let scale = if at.control.is_some() { duration } else { 1.0 };
        let mut value = 0.0;
        for term in self.terms(at) {
            value += scale * term.value(at)?;
        }
        check(at, "value", value)?;
        Ok(value)
    }

    /// Value and derivatives at a knot. Of changes of controls only the value.
    pub fn quadratic(&self, at: &CostPoint, duration: f64) -> Result<Quadratic> {
        let scale = if at.control.is_some() { duration } else { 1.0 };
        let mut out = Quadratic::zeros(self.sizes.states(), self.sizes.controls);
        for term in self.terms(at) {
            term.add(at, scale, &mut out)?;
            if let BoundTerm::Change(_) = term {
                out.value += scale * term.value(at)?;
            }
        }
        for (name, _, numbers) in out.parts() {
            for x in numbers {
                check(at, name, *x)?;
            }
        }
        Ok(out)
    }
}

/// Refuses what isn't a number.
fn check(at: &CostPoint, what: &str, x: f64) -> Result<()> {
    match x.is_finite() {
        true => Ok(()),
        false => Err(Error::Unresolved {
            place: format!("cost at knot {}", at.knot),
            quantity: what.into(),
            value: x,
            limit: f64::MAX,
            remedy:
                "take smaller weights, targets nearer by, or a custom cost that is finite there"
                    .into(),
        }),
    }
}
