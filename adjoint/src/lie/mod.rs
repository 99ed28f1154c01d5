//! Rigid motions: rotations, poses, spatial twists and wrenches.
//!
//! Conventions. A pose maps body to world, `x_world = R x_body + t`. A displacement of a pose is
//! `δg = (δt, δθ)` with `δR = [δθ]× R` (world frame, on the left). A *spatial* twist
//! `V = (u, ω)` is the velocity field `u + ω × x` of the world points moving with the body, that is, `u`
//! is the velocity of the material point that passes the world origin; a spatial wrench `(f, τ)`
//! has its moment about the world origin, and `power = V · F`. Six-vectors are linear first,
//! angular second; units m/s, rad/s, N, N·m.

mod pose;
mod rotation;
mod twist;

pub use pose::Pose;
pub use rotation::{
    exp, exp_jacobian, exp_jacobian_inverse, exp_jacobian_inverse_jvp, exp_jacobian_inverse_vjp,
    exp_matrix, skew, unit, unskew,
};
pub use twist::{cross_force, cross_motion, point_velocity, point_wrench};

/// Three-vector.
pub type Vec3 = nalgebra::Vector3<f64>;
/// Six-vector: linear part first, angular part second.
pub type Vec6 = nalgebra::Vector6<f64>;
/// 3 × 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
/// 6 × 6 matrix.
pub type Mat6 = nalgebra::Matrix6<f64>;

/// Linear part of a six-vector.
#[inline]
pub fn linear(v: &Vec6) -> Vec3 {
    v.fixed_rows::<3>(0).into_owned()
}

/// Angular part of a six-vector.
#[inline]
pub fn angular(v: &Vec6) -> Vec3 {
    v.fixed_rows::<3>(3).into_owned()
}

/// Six-vector from its linear and angular parts.
#[inline]
pub fn six(linear: &Vec3, angular: &Vec3) -> Vec6 {
    Vec6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}
