//! The normals of a straight edge, and where along them a round body sinks in least.
//!
//! With n across the edge, p on it and x outermost of the round body along −n, f(n) = n · (x − p) is minus the shift along n that parts
//! the two. Seen along the edge the body is a disc, the edge a point in it, and f at its tops minus the way to a
//! nearest point of the border. Unlike the distance at the lowest place of the edge f has no kink where the edge crosses the middle of the body.

use super::point::{ContactPoint, Slopes, carry, columns};
use crate::geometry::convex::{Edge, Support, perpendicular, rising_root};
use hydrograd_adjoint::lie::{Mat3, Vec3, Vec6, skew};
use std::f64::consts::PI;

/// Angle between the normals at which tops are looked for first, rad.
const STEP: f64 = 0.2;
/// Least curvature of f at a top, in sizes of the edge.
const FLOOR: f64 = 1e-9;

/// The normals between those of the faces of an edge, or all across one without faces.
pub(super) struct Arc<'e> {
    edge: &'e Edge,
    middle: Vec3,
    aside: Vec3,
    /// Angle to either end, rad.
    half: f64,
}

/// A normal at which f is larger than at its neighbours.
pub(super) struct Top {
    /// f, m.
    pub height: f64,
    /// Out of the edge's body.
    pub normal: Vec3,
    /// Derivative of the normal along the arc.
    tangent: Vec3,
    /// The round body's outermost point against the normal.
    pub support: Support,
}

impl<'e> Arc<'e> {
    /// Of an edge in the world frame, and by `room` (rad) further.
    pub fn of(edge: &'e Edge, room: f64) -> Self {
        let along = &edge.along;
        let (middle, half) = match edge.inward {
            Some([first, second]) => {
                let (first, second) = (along.cross(&first), second.cross(along));
                let middle = (first + second).normalize();
                (middle, middle.angle(&first) + room)
            }
            None => (perpendicular(along), PI),
        };
        Self {
            edge,
            middle,
            aside: along.cross(&middle),
            half,
        }
    }

    /// f and its first two derivatives at an angle from the middle of the arc.
    fn at(&self, angle: f64, outermost: &impl Fn(&Vec3) -> Support) -> (Top, f64, f64) {
        let (sin, cos) = angle.sin_cos();
        let normal = cos * self.middle + sin * self.aside;
        let tangent = cos * self.aside - sin * self.middle;
        let support = outermost(&-normal);
        let way = support.point - self.edge.from;
        let height = normal.dot(&way);
        let bend = -tangent.dot(&(support.spread * tangent)) - height;
        let top = Top {
            height,
            normal,
            tangent,
            support,
        };
        (top, tangent.dot(&way), bend)
    }

    /// The tops between the ends of the arc, with the outermost points of the round body (world frame).
    pub fn tops(&self, outermost: impl Fn(&Vec3) -> Support) -> Vec<Top> {
        let parts = (2.0 * self.half / STEP).ceil().max(1.0);
        let angle = |k: f64| self.half * (2.0 * k / parts - 1.0);
        let mut out = Vec::new();
        let mut rising = false;
        for k in 0..=parts as usize {
            let (low, high) = (angle(k as f64 - 1.0), angle(k as f64));
            let slope = self.at(high, &outermost).1;
            if rising && slope <= 0.0 {
                out.push(self.between(low, high, &outermost));
            }
            rising = slope > 0.0;
        }
        out
    }

    /// The top between an angle at which f rises and one at which it doesn't.
    fn between(&self, low: f64, high: f64, outermost: &impl Fn(&Vec3) -> Support) -> Top {
        let falls = |angle: f64| {
            let (_, slope, bend) = self.at(angle, outermost);
            (-slope, -bend)
        };
        let angle = rising_root([low, high], 0.5 * (low + high), 1e-16, falls);
        self.at(angle, outermost).0
    }

    /// The contact at a top: the round body is the first, and the edge's has `radius` about it.
    ///
    /// The outermost point x moves by C dζ − S dn. With the tangent t, dn = t dφ and t · (x − p) stays zero: (f + tᵀ S t) dφ = t · C dζ.
    pub fn contact(&self, top: &Top, radius: f64) -> ContactPoint {
        let (normal, tangent) = (&top.normal, &top.tangent);
        let Support { point: x, spread } = &top.support;
        let along = &self.edge.along;
        let on_edge = self.edge.from + along.dot(&(x - self.edge.from)) * along;
        let bend = top.height + tangent.dot(&(spread * tangent));
        let carried = columns(&Mat3::identity(), &(-skew(x) - spread * skew(normal)));
        let turned = carried.tr_mul(tangent) / bend.max(FLOOR * self.edge.length);
        let normal_slope = tangent * turned.transpose();
        let moved = carried - spread * normal_slope;
        let slid = along * moved.tr_mul(along).transpose();
        ContactPoint {
            gap: top.height - radius,
            weight: 1.0,
            normal: *normal,
            position: 0.5 * (x + on_edge + radius * normal),
            slopes: Slopes {
                gap: carry(x).tr_mul(normal),
                weight: Vec6::zeros(),
                normal: normal_slope,
                position: 0.5 * (moved + slid + radius * normal_slope),
            },
        }
    }
}
