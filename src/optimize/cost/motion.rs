//! Residuals of motion, with their Jacobians by (q, v).

use super::{CostPoint, Target};
use crate::adjoint::lie::{Mat3, Pose, Vec3, exp_jacobian_inverse, exp_matrix};
use crate::simulate::{Simulator, observable};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector, Rotation3, UnitQuaternion};

/// What is to be small at a knot.
pub(super) trait Residual: Send + Sync {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>>;

    /// The value and its derivatives, entries × 2nv.
    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)>;
}

/// q ⊖ target.
pub(super) struct Configuration(pub Target);

impl Residual for Configuration {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>> {
        let tree = &at.rollout.simulator().system().tree;
        let (a, b, part) = self.0.at(at.sample().time);
        let mut goal = DVector::from_column_slice(a);
        if part > 0.0 {
            let way = tree.difference(&goal, &DVector::from_column_slice(b));
            goal = tree.integrate(&goal, &(part * way));
        }
        Ok(tree.difference(&goal, &at.sample().q))
    }

    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let tree = &at.rollout.simulator().system().tree;
        let value = self.value(at)?;
        let nv = value.len();
        let mut out = DMatrix::zeros(nv, 2 * nv);
        let (still, none) = (DVector::zeros(nv), DMatrix::zeros(nv, nv));
        // The rate of the difference as q moves.
        let own = tree.chart_rate_jvp(&value, &still, &none, &DMatrix::identity(nv, nv));
        out.columns_mut(0, nv).copy_from(&own);
        Ok((value, out))
    }
}

/// v − target.
pub(super) struct Velocity(pub Target);

impl Residual for Velocity {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>> {
        let sample = at.sample();
        let mut goal = self.0.plain(sample.time);
        Ok(sample.v.map(|v| v - goal.next().unwrap_or(0.0)))
    }

    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let value = self.value(at)?;
        let nv = value.len();
        let mut out = DMatrix::zeros(nv, 2 * nv);
        out.columns_mut(nv, nv).fill_with_identity();
        Ok((value, out))
    }
}

/// A frame fixed to a body.
pub(super) struct Frame {
    body: usize,
    pose: Pose,
}

impl Frame {
    /// That of a body or site.
    pub fn named(simulator: &Simulator, place: &str, name: &str) -> Result<Self> {
        let system = simulator.system();
        if let Some(site) = system.sites.iter().find(|s| s.name == name) {
            return Ok(Self {
                body: site.body,
                pose: site.pose,
            });
        }
        if let Some(body) = system.bodies.iter().position(|b| b.name == name) {
            return Ok(Self {
                body,
                pose: Pose::identity(),
            });
        }
        let sites = system.sites.iter().map(|s| s.name.as_str());
        let bodies = system.bodies.iter().map(|b| b.name.as_str());
        let known: Vec<&str> = sites.chain(bodies).collect();
        Err(Error::input(
            format!("{place}: frame"),
            format!("{name:?}"),
            format!("must be a site or a body: one of {known:?}"),
        ))
    }

    /// With its origin at a point of it.
    pub fn at(mut self, point: &[f64; 3]) -> Self {
        self.pose.translation = self.pose.apply(&Vec3::from(*point));
        self
    }

    fn in_world(&self, at: &CostPoint) -> Pose {
        at.sample().poses[self.body].compose(&self.pose)
    }

    /// Velocity of its origin and its angular velocity per generalised velocity, 6 × nv.
    fn jacobian(&self, at: &CostPoint, origin: &Vec3) -> DMatrix<f64> {
        let tree = &at.rollout.simulator().system().tree;
        let kinematics = tree.kinematics(&at.sample().q);
        tree.point_jacobian(&kinematics, self.body, origin)
    }
}

/// With zeros for the velocity.
fn of_q(by_q: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, nv) = by_q.shape();
    let mut out = DMatrix::zeros(rows, 2 * nv);
    out.columns_mut(0, nv).copy_from(by_q);
    out
}

fn three(x: &Vec3) -> DVector<f64> {
    DVector::from_column_slice(x.as_slice())
}

/// Origin of a frame less the target.
pub(super) struct Position(pub Frame, pub Target);

impl Position {
    fn miss(&self, at: &CostPoint, origin: &Vec3) -> DVector<f64> {
        let mut goal = self.1.plain(at.sample().time);
        three(&origin.map(|x| x - goal.next().unwrap_or(0.0)))
    }
}

impl Residual for Position {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>> {
        Ok(self.miss(at, &self.0.in_world(at).translation))
    }

    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let origin = self.0.in_world(at).translation;
        let all = self.0.jacobian(at, &origin);
        Ok((self.miss(at, &origin), of_q(&all.rows(0, 3).into_owned())))
    }
}

/// Rotation vector from the target's axes to a frame's, world axes.
pub(super) struct Orientation(pub Frame, pub Target);

/// Rotation vector of a rotation, the shorter way.
fn log(rotation: &Mat3) -> Vec3 {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation)).scaled_axis()
}

impl Orientation {
    fn miss(&self, at: &CostPoint) -> Vec3 {
        let (a, b, part) = self.1.at(at.sample().time);
        let turn = |x: &[f64]| exp_matrix(&Vec3::from_column_slice(x));
        let mut goal = turn(a);
        if part > 0.0 {
            let way = log(&(turn(b) * goal.transpose()));
            goal = exp_matrix(&(part * way)) * goal;
        }
        log(&(self.0.in_world(at).rotation * goal.transpose()))
    }
}

impl Residual for Orientation {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>> {
        Ok(three(&self.miss(at)))
    }

    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let miss = self.miss(at);
        let all = self.0.jacobian(at, &Vec3::zeros());
        let by_q = exp_jacobian_inverse(&miss) * all.rows(3, 3);
        Ok((
            three(&miss),
            of_q(&DMatrix::from_column_slice(
                3,
                by_q.ncols(),
                by_q.as_slice(),
            )),
        ))
    }
}

/// Entries of an observable less the target.
pub(super) struct Observed {
    pub name: String,
    pub entries: Vec<usize>,
    pub target: Target,
}

impl Observed {
    /// Refuses observables without derivatives, with entries that aren't independent, and entries that there aren't.
    pub fn check(&self, simulator: &Simulator, place: &str) -> Result<()> {
        let system = simulator.system();
        let rows: usize = observable::observable(&self.name)?
            .shape(system)
            .iter()
            .product();
        let found = observable::differentiable(&self.name)?;
        if found.is_gain() {
            return Err(Error::input(
                format!("{place}: name"),
                format!("{:?}", self.name),
                "must be read from one state, and this is the mean over a step: take `velocities`, or the controls' `change`",
            ));
        }
        if self.entries.is_empty() || self.entries.iter().any(|e| *e >= rows) {
            return Err(Error::input(
                format!("{place}: entries"),
                format!("{:?}", self.entries),
                format!(
                    "must be at least one, each under {rows}, the number of the observable's entries"
                ),
            ));
        }
        for entry in &self.entries {
            if observable::tangent_of(&self.name, system, *entry)?.is_none() {
                return Err(Error::input(
                    format!("{place}: entries"),
                    format!("{entry} of {:?}", self.name),
                    "must move by itself, and be no part of the place of a joint that turns in three dimensions or of a rotation matrix: take `configuration` or `orientation`",
                ));
            }
        }
        Ok(())
    }

    fn miss(&self, at: &CostPoint, all: &[f64]) -> Result<DVector<f64>> {
        let observable = observable::observable(&self.name)?;
        let goals = self.target.plain(at.sample().time);
        let each = self.entries.iter().zip(goals);
        let misses = each.map(|(e, goal)| observable.miss(all[*e], goal));
        Ok(DVector::from_iterator(self.entries.len(), misses))
    }
}

impl Residual for Observed {
    fn value(&self, at: &CostPoint) -> Result<DVector<f64>> {
        let all = at.rollout.observable_value(&self.name, at.state)?;
        self.miss(at, &all)
    }

    fn jacobian(&self, at: &CostPoint) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let (all, jacobian) = at.rollout.observable_jacobian(&self.name, at.state)?;
        let system = at.rollout.simulator().system();
        let tangent = |e: &usize| Ok(observable::tangent_of(&self.name, system, *e)?.unwrap_or(*e));
        let tangents: Vec<usize> = self.entries.iter().map(tangent).collect::<Result<_>>()?;
        let rows: Vec<_> = tangents.iter().map(|t| jacobian.row(*t)).collect();
        Ok((self.miss(at, &all)?, DMatrix::from_rows(&rows)))
    }
}
