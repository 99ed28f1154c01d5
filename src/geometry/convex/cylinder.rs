//! Circular cylinders and the discs at their ends: support points and signed distances.

use super::field::{AtCorner, Field, across, leaves, perpendicular};
use super::round::{Approach, Round, Support, lowest};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};

/// Share of a radius below which a distance is rounding.
const ROUNDING: f64 = 1e-13;

/// Share of an edge's size within which its lowest place over a disc is one at which it pierces that.
const PIERCED: f64 = 1e-12;

/// A disc across z about the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    /// m.
    pub radius: f64,
}

/// A circular cylinder along z about the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cylinder {
    /// m.
    pub radius: f64,
    /// Half its length, m.
    pub half: f64,
}

impl Cylinder {
    /// The disc at either end.
    pub fn disc(&self) -> Disc {
        Disc {
            radius: self.radius,
        }
    }

    /// Where the disc at the upper (1) or lower (−1) end is, for the pose of the cylinder.
    pub fn end(&self, at: &Pose, side: f64) -> Pose {
        Pose::new(
            at.rotation,
            at.apply(&Vec3::new(0.0, 0.0, side * self.half)),
        )
    }

    /// The outermost point in a direction of any length, frame of the cylinder.
    pub fn outermost(&self, direction: &Vec3) -> Vec3 {
        let rim = outermost(self.radius, direction);
        Vec3::new(rim.x, rim.y, self.half.copysign(direction.z))
    }

    /// Signed distance of a point, frame of the cylinder: inside, from the nearer of side and ends.
    pub fn field(&self, y: &Vec3) -> Field {
        self.field_of_corner(y, &[]).field
    }

    /// The same of the corner of another body, which it leaves `into` these directions (unit vectors): inside, from the nearer of those through which the other body may leave.
    pub fn field_of_corner(&self, y: &Vec3, into: &[Vec3]) -> AtCorner {
        let aside = y.x.hypot(y.y);
        let (beside, above) = (aside - self.radius, y.z.abs() - self.half);
        let up = Vec3::new(0.0, 0.0, 1f64.copysign(y.z));
        if beside > 0.0 && above > 0.0 {
            let field = rim(y, aside, beside, above, &up, ROUNDING * self.radius);
            return AtCorner { field, over: false };
        }
        let within = beside <= 0.0 && above <= 0.0;
        let on_axis = aside <= ROUNDING * self.radius;
        let gradient = match on_axis {
            true => Vec3::x(),
            false => Vec3::new(y.x, y.y, 0.0) / aside,
        };
        let by_end = match (leaves(&up, into), leaves(&gradient, into)) {
            (true, false) if within => true,
            (false, true) if within => false,
            _ => above >= beside,
        };
        if by_end {
            return AtCorner::flat(above, up);
        }
        if on_axis {
            return AtCorner::flat(beside, gradient);
        }
        let around = up.cross(&gradient);
        AtCorner {
            field: Field {
                distance: beside,
                gradient,
                hessian: around * around.transpose() / aside,
            },
            over: beside > 0.0,
        }
    }
}

impl Round for Disc {
    const HAS_INSIDE: bool = false;

    /// `c + r p/|p|` with p the direction's part in the plane of the disc; of the directions along the axis, which all
    /// points of the disc are outermost in, any.
    fn support(&self, at: &Pose, direction: &Vec3) -> Support {
        let axis = at.rotation.column(2).into_owned();
        let flat = direction - axis * axis.dot(direction);
        let length = flat.norm();
        if length == 0.0 {
            return Support {
                point: at.translation + self.radius * perpendicular(&axis),
                spread: Mat3::zeros(),
            };
        }
        let out = flat / length;
        // Near the axis what is left has lost digits, and leans from the disc.
        let out = (out - axis * axis.dot(&out)).normalize();
        let around = axis.cross(&out);
        Support {
            point: at.translation + self.radius * out,
            spread: around * around.transpose() * (self.radius / length),
        }
    }

    fn field(&self, y: &Vec3) -> Field {
        let aside = y.x.hypot(y.y);
        let beside = aside - self.radius;
        let up = Vec3::new(0.0, 0.0, 1f64.copysign(y.z));
        if beside <= 0.0 {
            return Field::flat(y.z.abs(), up);
        }
        rim(y, aside, beside, y.z.abs(), &up, ROUNDING * self.radius)
    }

    fn approach(&self, from: &Vec3, along: &Vec3, length: f64) -> Approach {
        let at = (-from.dot(along)).clamp(0.0, length);
        Approach {
            at,
            least: self.least(&(from + at * along)),
            pierced: false,
        }
    }

    fn least(&self, x: &Vec3) -> f64 {
        x.norm() - self.radius
    }

    /// None of an edge that pierces the disc: what is lowest there is in it, and on which side is rounding.
    fn lowest(&self, from: &Vec3, along: &Vec3, length: f64) -> Option<f64> {
        let first = self.approach(from, along, length).at;
        let s = lowest(&|x| self.field(x), from, along, length, first)?;
        let x = from + s * along;
        let pierced =
            x.x.hypot(x.y) <= self.radius && x.z.abs() <= PIERCED * (length + from.amax());
        (!pierced).then_some(s)
    }
}

/// The outermost point of a disc in a direction, frame of the disc; its middle along the axis.
pub(super) fn outermost(radius: f64, direction: &Vec3) -> Vec3 {
    let size = direction.x.hypot(direction.y);
    if size == 0.0 {
        return Vec3::zeros();
    }
    Vec3::new(direction.x, direction.y, 0.0) * (radius / size)
}

/// Distance from a rim at a point `aside` from the axis, `beside` the rim and `above` its plane, on the side `up`. The
/// parallel surface is a torus: it bends as a circle about the rim, and around the axis.
fn rim(y: &Vec3, aside: f64, beside: f64, above: f64, up: &Vec3, least: f64) -> Field {
    let outward = Vec3::new(y.x, y.y, 0.0) / aside;
    let distance = beside.hypot(above);
    if distance <= least {
        return Field::flat(distance, (outward + up).normalize());
    }
    let gradient = (beside * outward + above * up) / distance;
    let around = up.cross(&outward);
    let turned = around * around.transpose();
    Field {
        distance,
        gradient,
        hessian: (across(&gradient) - turned) / distance + turned * (beside / distance / aside),
    }
}
