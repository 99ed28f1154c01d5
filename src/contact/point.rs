//! The point of a contact and how it moves: how points and directions do along a spatial displacement.

use crate::geometry::convex::Field;
use hydrograd_adjoint::lie::{Mat3, Vec3, Vec6, skew};
use nalgebra::SMatrix;

/// One place where two surfaces are near.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPoint {
    /// Signed distance there, m; negative: overlapping.
    pub gap: f64,
    /// Scale of the force, from 0 to 1: below 1 where the point fades out and others take over.
    pub weight: f64,
    /// Unit normal, world frame, from the second body (or wall) to the first.
    pub normal: Vec3,
    /// Where the force acts on both, world frame, m: midway between the two witness points.
    pub position: Vec3,
    /// First derivatives.
    pub slopes: Slopes,
}

/// Derivatives along a spatial displacement ζ = (translation, rotation about the world origin) of
/// the first body, the second at rest: the pose of the first becomes `exp(ε ζ)` times itself.
///
/// When both move, by ζ₁ and ζ₂, the change is the slope times ζ₁ − ζ₂ plus what being carried
/// rigidly by ζ₂ does: nothing to gap and weight, `ω₂ × n` to the normal, `u₂ + ω₂ × x` to the
/// position.
#[derive(Clone, Debug, PartialEq)]
pub struct Slopes {
    /// Of the gap: m/m, m/rad.
    pub gap: Vec6,
    /// Of the weight: 1/m, 1/rad.
    pub weight: Vec6,
    /// Of the normal: 1/m, 1/rad.
    pub normal: Rows3,
    /// Of the position: m/m, m/rad.
    pub position: Rows3,
}

impl ContactPoint {
    /// A point of the first body that moves by `motion`, with radius `radii[0]` about it, in the
    /// distance field (world frame) of the second body's core, which has radius `radii[1]`.
    ///
    /// With φ, n, H of the field: gap φ − r₁ − r₂, normal n, witness points p − r₁ n and
    /// p − (φ − r₂) n; dφ = n · dp, dn = H dp.
    pub(super) fn probe(point: &Vec3, motion: &Rows3, radii: [f64; 2], field: &Field) -> Self {
        let back = 0.5 * (radii[0] - radii[1] + field.distance);
        let normal = field.gradient;
        let gap_slope = motion.tr_mul(&normal);
        let normal_slope = field.hessian * motion;
        Self {
            gap: field.distance - radii[0] - radii[1],
            weight: 1.0,
            normal,
            position: point - back * normal,
            slopes: Slopes {
                gap: gap_slope,
                weight: Vec6::zeros(),
                normal: normal_slope,
                position: motion - back * normal_slope - 0.5 * normal * gap_slope.transpose(),
            },
        }
    }

    /// The same place seen with the bodies in the other order. Moving the new first body by ζ is
    /// moving the old one by −ζ and carrying both by ζ.
    pub(super) fn swapped(self) -> Self {
        Self {
            gap: self.gap,
            weight: self.weight,
            normal: -self.normal,
            position: self.position,
            slopes: Slopes {
                gap: -self.slopes.gap,
                weight: -self.slopes.weight,
                normal: self.slopes.normal - rotate(&self.normal),
                position: carry(&self.position) - self.slopes.position,
            },
        }
    }
}

/// Slope of a three-vector along a spatial displacement (m/m, then m/rad; or 1/m, 1/rad).
pub type Rows3 = SMatrix<f64, 3, 6>;

/// Velocity of the material point at `x` along a spatial displacement, `u + ω × x`.
pub(super) fn carry(x: &Vec3) -> Rows3 {
    columns(&Mat3::identity(), &-skew(x))
}

/// Rotation of a direction `v` that moves with the body, `ω × v`.
pub(super) fn rotate(v: &Vec3) -> Rows3 {
    columns(&Mat3::zeros(), &-skew(v))
}

/// From the parts along translation and rotation.
pub(super) fn columns(translation: &Mat3, rotation: &Mat3) -> Rows3 {
    let mut out = Rows3::zeros();
    out.fixed_columns_mut::<3>(0).copy_from(translation);
    out.fixed_columns_mut::<3>(3).copy_from(rotation);
    out
}
