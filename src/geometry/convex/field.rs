//! The signed distance of a point from a surface, with its first two derivatives.

use hydrograd_adjoint::lie::{Mat3, Vec3};

/// Signed distance from a surface at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    /// m; negative inside.
    pub distance: f64,
    /// Unit vector away from the surface.
    pub gradient: Vec3,
    /// Second derivative, 1/m.
    pub hessian: Mat3,
}

/// The signed distance at the corner of another body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AtCorner {
    pub field: Field,
    /// Whether the corner is outside, over a face or a side rather than at an edge.
    pub over: bool,
}

impl AtCorner {
    /// The same in a frame that `rotation` leads to.
    pub fn rotated(&self, rotation: &Mat3) -> Self {
        Self {
            field: self.field.rotated(rotation),
            over: self.over,
        }
    }

    /// Over a face.
    pub fn flat(distance: f64, normal: Vec3) -> Self {
        Self {
            field: Field::flat(distance, normal),
            over: distance > 0.0,
        }
    }
}

impl Field {
    /// Over a face.
    pub fn flat(distance: f64, normal: Vec3) -> Self {
        Self {
            distance,
            gradient: normal,
            hessian: Mat3::zeros(),
        }
    }

    /// About an edge along the unit vector `axis`, or a corner; `offset` leads from the nearest
    /// point there to the point asked for. Nearer than `least`, where the offset has no direction
    /// beyond rounding, one direction is taken for all.
    pub fn round(offset: Vec3, axis: Option<&Vec3>, least: f64) -> Self {
        let distance = offset.norm();
        if distance <= least {
            let gradient = axis.map_or(Vec3::x(), perpendicular);
            return Self::flat(distance, gradient);
        }
        let gradient = offset / distance;
        let along = axis.map_or(Mat3::zeros(), |a| a * a.transpose());
        Self {
            distance,
            gradient,
            hessian: (across(&gradient) - along) / distance,
        }
    }

    /// The distance seen from the other side of the surface.
    pub fn negated(&self) -> Self {
        Self {
            distance: -self.distance,
            gradient: -self.gradient,
            hessian: -self.hessian,
        }
    }

    /// The same in a frame that `rotation` leads to.
    pub fn rotated(&self, rotation: &Mat3) -> Self {
        Self {
            distance: self.distance,
            gradient: rotation * self.gradient,
            hessian: rotation * self.hessian * rotation.transpose(),
        }
    }
}

/// Sine of the angle by which a corner's edges may lean against a way out.
const AGAINST: f64 = 0.5;

/// Whether a body may leave along a normal by a corner from which it leads `into` these directions: where bodies are flush the nearest face of one may be a side that the other
/// stands across.
pub(super) fn leaves(normal: &Vec3, into: &[Vec3]) -> bool {
    into.iter().all(|d| normal.dot(d) >= -AGAINST)
}

/// `I − n nᵀ`.
pub(crate) fn across(n: &Vec3) -> Mat3 {
    Mat3::identity() - n * n.transpose()
}

/// A unit vector across a unit vector.
pub(crate) fn perpendicular(axis: &Vec3) -> Vec3 {
    axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize()
}
