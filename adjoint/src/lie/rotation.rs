//! Rotation vectors: exponential, its matrix, and the left Jacobian, right at zero rotation.
//!
//! The coefficients `sin θ/θ`, `(1 − cos θ)/θ²`, … are functions of `s = θ²` with a Taylor branch,
//! so that values and all derivatives are finite and right at θ = 0.

use super::{Mat3, Vec3};
use nalgebra::UnitQuaternion;

/// The unit vector along a vector of any length that isn't zero: over its largest component first, as its square may leave double precision.
pub fn unit(a: &Vec3) -> Vec3 {
    (a / a.amax()).normalize()
}

/// Matrix of the cross product, `skew(a) b = a × b`.
#[inline]
pub fn skew(a: &Vec3) -> Mat3 {
    a.cross_matrix()
}

/// Axial vector of a matrix's skew part: `trace(skew(x)ᵀ m) = x · unskew(m)`.
#[inline]
pub fn unskew(m: &Mat3) -> Vec3 {
    Vec3::new(
        m[(2, 1)] - m[(1, 2)],
        m[(0, 2)] - m[(2, 0)],
        m[(1, 0)] - m[(0, 1)],
    )
}

/// Below this θ² the series is used; with the terms kept its error is under 1e-17.
const SERIES: f64 = 1e-2;

/// `sin θ/θ`, `(1 − cos θ)/θ²`, `(θ − sin θ)/θ³` as functions of `s = θ²`.
fn coefficients(s: f64) -> (f64, f64, f64) {
    if s < SERIES {
        let a = 1.0
            - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0))));
        let b = 0.5
            * (1.0
                - s / 12.0
                    * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0)))));
        let c = (1.0
            - s / 20.0
                * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0 * (1.0 - s / 156.0)))))
            / 6.0;
        (a, b, c)
    } else {
        let t = s.sqrt();
        let half = (0.5 * t).sin();
        (t.sin() / t, 2.0 * half * half / s, (t - t.sin()) / (s * t))
    }
}

/// Derivatives with respect to `s` of the first two of [`coefficients`].
fn coefficient_slopes(s: f64) -> (f64, f64) {
    if s < SERIES {
        let a = -1.0 / 6.0 + s / 60.0 * (1.0 - s / 28.0 * (1.0 - s / 54.0 * (1.0 - s / 88.0)));
        let b = -1.0 / 24.0
            + s / 360.0 * (1.0 - s / 37.333_333_333_333_336 * (1.0 - s / 67.5 * (1.0 - s / 105.6)));
        (a, b)
    } else {
        let (a, b, _) = coefficients(s);
        ((s.sqrt().cos() - a) / (2.0 * s), (a - 2.0 * b) / (2.0 * s))
    }
}

/// `exp([θ]×)` as a unit quaternion.
pub fn exp(theta: &Vec3) -> UnitQuaternion<f64> {
    let (half_sinc, _, _) = coefficients(0.25 * theta.norm_squared());
    let cos = (0.5 * theta.norm()).cos();
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::from_parts(
        cos,
        0.5 * half_sinc * theta,
    ))
}

/// `exp([θ]×)` as a matrix (Rodrigues, Eq. 4 of the paper's chart).
pub fn exp_matrix(theta: &Vec3) -> Mat3 {
    let (a, b, _) = coefficients(theta.norm_squared());
    let k = skew(theta);
    Mat3::identity() + a * k + b * k * k
}

/// Left Jacobian: `exp(θ + δθ) = exp(J δθ) exp(θ)` to first order. At θ = 0 it is the identity,
/// and its derivative along `a` is `½ [a]×`: the velocity map of the paper's Eq. 5.
pub fn exp_jacobian(theta: &Vec3) -> Mat3 {
    let (_, b, c) = coefficients(theta.norm_squared());
    let k = skew(theta);
    Mat3::identity() + b * k + c * k * k
}

/// Inverse of [`exp_jacobian`]: the rate `θ̇ = J⁻¹ ω` of a rotation vector turning at `ω`.
/// Defined for |θ| < 2π.
pub fn exp_jacobian_inverse(theta: &Vec3) -> Mat3 {
    let s = theta.norm_squared();
    let (a, b, _) = coefficients(s);
    // (1 − a/(2b))/s, with its series where both terms cancel.
    let c = if s < SERIES {
        (1.0 + s / 60.0 * (1.0 + s / 42.0 * (1.0 + s / 40.0))) / 12.0
    } else {
        (1.0 - a / (2.0 * b)) / s
    };
    let k = skew(theta);
    Mat3::identity() - 0.5 * k + c * k * k
}

/// Coefficient of `[θ]×²` in [`exp_jacobian_inverse`] as a function of `s = θ²`, with its derivative.
fn inverse_coefficient(s: f64) -> (f64, f64) {
    let (a, b, _) = coefficients(s);
    if s < SERIES {
        (
            (1.0 + s / 60.0 * (1.0 + s / 42.0 * (1.0 + s / 40.0))) / 12.0,
            (1.0 + s / 21.0 * (1.0 + s * 3.0 / 80.0)) / 720.0,
        )
    } else {
        let (da, db) = coefficient_slopes(s);
        let c = (1.0 - a / (2.0 * b)) / s;
        (c, ((a * db - da * b) / (2.0 * b * b) - c) / s)
    }
}

/// Tangent of `exp_jacobian_inverse(θ) ω` along `dtheta`.
pub fn exp_jacobian_inverse_jvp(theta: &Vec3, omega: &Vec3, dtheta: &Vec3) -> Vec3 {
    let s = theta.norm_squared();
    let (c, dc) = inverse_coefficient(s);
    let (t, w, d) = (theta, omega, dtheta);
    // As in the transpose.
    let twice = t * t.dot(w) - w * s;
    -0.5 * d.cross(w)
        + 2.0 * dc * t.dot(d) * twice
        + c * (d * t.dot(w) + t * d.dot(w) - 2.0 * w * t.dot(d))
}

/// Cotangent of `θ` from the cotangent of `exp_jacobian_inverse(θ) ω`.
pub fn exp_jacobian_inverse_vjp(theta: &Vec3, omega: &Vec3, rate_bar: &Vec3) -> Vec3 {
    let s = theta.norm_squared();
    let (c, dc) = inverse_coefficient(s);
    let (t, w, r) = (theta, omega, rate_bar);
    // −½ θ×ω, then c(s) θ×(θ×ω) with θ×(θ×ω) = θ(θ·ω) − ω s.
    let twice = t * t.dot(w) - w * s;
    -0.5 * w.cross(r)
        + 2.0 * dc * twice.dot(r) * t
        + c * (r * t.dot(w) + w * t.dot(r) - 2.0 * w.dot(r) * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_and_jacobians_agree_with_differences_on_both_branches() {
        for scale in [0.0, 1e-9, 0.05, 0.0999, 0.1001, 1.0, 3.0] {
            let theta = Vec3::new(0.36, -0.48, 0.8) * scale;
            let r = exp_matrix(&theta);
            assert!((r - exp(&theta).to_rotation_matrix().into_inner()).norm() < 1e-14);
            assert!((r * r.transpose() - Mat3::identity()).norm() < 1e-14);
            let product = exp_jacobian(&theta) * exp_jacobian_inverse(&theta);
            assert!((product - Mat3::identity()).norm() < 1e-13, "{scale}");
            let (w, bar3) = (Vec3::new(0.4, 1.3, -0.7), Vec3::new(-0.9, 0.2, 0.6));
            let rate_bar = exp_jacobian_inverse_vjp(&theta, &w, &bar3);
            for k in 0..3 {
                let h = 1e-6;
                let mut e = Vec3::zeros();
                e[k] = h;
                let (p, n) = (exp_matrix(&(theta + e)), exp_matrix(&(theta - e)));
                let difference = (p - n) / (2.0 * h);
                let rates = exp_jacobian_inverse(&(theta + e)) - exp_jacobian_inverse(&(theta - e));
                let slope = (rates * w).dot(&bar3) / (2.0 * h);
                assert!(
                    (slope - rate_bar[k]).abs() < 1e-8,
                    "{scale} {slope} {}",
                    rate_bar[k]
                );
                let rotation = unskew(&(difference * r.transpose())) / 2.0;
                assert!((rotation - exp_jacobian(&theta).column(k)).norm() < 1e-9);
            }
        }
    }
}
