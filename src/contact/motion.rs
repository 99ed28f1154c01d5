//! How points and directions move along a spatial displacement, and unit vectors.

use hydrograd_adjoint::lie::{Mat3, Vec3, Vec6, skew};
use nalgebra::SMatrix;

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

/// `I − n nᵀ`.
pub(super) fn across(n: &Vec3) -> Mat3 {
    Mat3::identity() - n * n.transpose()
}

/// The row `normal · (u + ω × x)`.
pub(super) fn advance(normal: &Vec3, x: &Vec3) -> Vec6 {
    carry(x).tr_mul(normal)
}

/// A unit vector across a unit vector.
pub(super) fn perpendicular(axis: &Vec3) -> Vec3 {
    axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize()
}
