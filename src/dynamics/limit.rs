//! Limits of joints: stops at the ends of a coordinate's range, by the law of contact without friction.
//!
//! With the gap φ = q − lower or upper − q and the rate u of the gap's opening, a stop's generalised force along the opening is
//! [`contact_force`] of a point that moves along its normal. The coordinate's rate is its velocity in the user's coordinates and
//! in the frame's (X = 1 for a joint with one coordinate), and so the force is the same in both.

use super::contact::sharpened;
use crate::adjoint::contact::{
    Law, PointState, Push, Rates, contact_force, contact_force_jvp, contact_force_vjp,
};
use crate::adjoint::lie::Vec3;

/// Range of a joint with one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimit {
    /// Place of the coordinate in q.
    pub q: usize,
    /// Place of its rate in v.
    pub v: usize,
    /// Lower and upper end, m or rad.
    pub range: [f64; 2],
    /// Law of the stops: lengths in m or rad, forces in N or N m.
    pub law: Law,
    /// Whether its stiffness is near rigid at the time step, so that it rises where a step is cut; one that was given stays what it is.
    pub rigid: bool,
}

/// Motion along the normal, which is x.
fn along(speed: f64) -> Rates {
    Rates {
        velocity: Vec3::x() * speed,
        ..Rates::default()
    }
}

impl JointLimit {
    /// Its range's length, m or rad.
    pub fn room(&self) -> f64 {
        self.range[1] - self.range[0]
    }

    /// How far the coordinate `q` is past either end, m or rad; negative within the range.
    pub fn past(&self, q: f64) -> f64 {
        (self.range[0] - q).max(q - self.range[1])
    }

    /// The same with a law that is as stiff in the `n`-th part of a step as it was in the whole.
    pub(super) fn sharpened(&self, n: usize) -> Self {
        Self {
            law: Law {
                width: self.law.width,
                ..sharpened(self.law, n)
            },
            ..self.clone()
        }
    }

    /// The point_state with either stop at the coordinate `q` and its rate `v`, with the sign of the force's direction.
    fn point_states(&self, q: f64, v: f64) -> [(f64, PointState); 2] {
        let [lower, upper] = self.range;
        [(1.0, q - lower), (-1.0, upper - q)].map(|(sign, gap)| {
            let point_state = PointState {
                gap,
                weight: 1.0,
                normal: Vec3::x(),
                rates: along(sign * v),
            };
            (sign, point_state)
        })
    }

    /// Generalised forces of the lower and the upper stop, N or N m: not negative, not positive.
    pub fn forces(&self, q: f64, v: f64) -> [f64; 2] {
        self.point_states(q, v)
            .map(|(sign, m)| sign * contact_force(&self.law, &m).force.x)
    }

    /// Tangent of the sum of [`JointLimit::forces`] along `dv`.
    pub fn forces_jvp(&self, q: f64, v: f64, dv: f64) -> f64 {
        self.point_states(q, v)
            .map(|(sign, m)| sign * contact_force_jvp(&self.law, &m, &along(sign * dv)).force.x)
            .iter()
            .sum()
    }

    /// Transpose of the sum of [`JointLimit::forces`]: cotangents of `q` and `v`.
    pub fn forces_vjp(&self, q: f64, v: f64, bar: f64) -> [f64; 2] {
        let mut out = [0.0; 2];
        for (sign, m) in self.point_states(q, v) {
            let push = Push {
                force: Vec3::x() * (sign * bar),
                ..Push::default()
            };
            let own = contact_force_vjp(&self.law, &m, &push);
            out[0] += sign * own.gap;
            out[1] += sign * own.rates.velocity.x;
        }
        out
    }
}
