//! Ellipsoids: support points and the signed distance.
//!
//! # References
//! D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid" (2013): the
//! scalar equation for the nearest point and the bracket of its root.

use super::field::{Field, across};
use super::round::{Approach, ROUNDS, Round, Support};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};

/// An ellipsoid along the axes of its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipsoid {
    /// m.
    pub semi_axes: Vec3,
}

impl Ellipsoid {
    /// The outermost point in a direction of any length, frame of the ellipsoid.
    pub fn outermost(&self, direction: &Vec3) -> Vec3 {
        // Over its largest component first: squares of small lengths may leave double precision.
        let flat = self.semi_axes.component_mul(direction);
        let flat = flat / flat.amax();
        let out = self.semi_axes.component_mul(&(flat / flat.norm()));
        match out.iter().all(|x| x.is_finite()) {
            true => out,
            false => Vec3::new(self.semi_axes.x, 0.0, 0.0),
        }
    }
}

impl Round for Ellipsoid {
    const HAS_INSIDE: bool = true;

    /// `c + Σ m/h` with h = √(mᵀ Σ m) and Σ = R D² Rᵀ, for a unit vector m.
    fn support(&self, at: &Pose, direction: &Vec3) -> Support {
        let squares = Mat3::from_diagonal(&self.semi_axes.component_mul(&self.semi_axes));
        let squares = at.rotation * squares * at.rotation.transpose();
        let across = squares * direction;
        let height = across.dot(direction).sqrt();
        Support {
            point: at.translation + across / height,
            spread: squares / height - across * across.transpose() / height.powi(3),
        }
    }

    /// Signed distance of a point, frame of the ellipsoid. On the symmetry planes inside, where two
    /// points of the surface are equally near, the one on the positive side is taken.
    ///
    /// The nearest point is xᵢ = aᵢ² yᵢ/(aᵢ² + t) with Σ (xᵢ/aᵢ)² = 1. The sum falls and is convex
    /// in t, so that Newton's method from the left of the root climbs to it.
    fn field(&self, y: &Vec3) -> Field {
        let a = &self.semi_axes;
        let least = a.imin();
        // τ = t + a_min²: no cancellation near the pole.
        let shift = a.map(|x| (x - a[least]) * (x + a[least]));
        let weighted = a.component_mul(&y.abs());
        let mut tau = (weighted - shift).max().max(0.0);
        // Without y along the shortest axis the sum has no pole at τ = 0 and may have no root.
        let rest: f64 = (0..3)
            .filter(|&i| shift[i] > 0.0)
            .map(|i| (weighted[i] / shift[i]).powi(2))
            .sum();
        let flat = (0..3).all(|i| shift[i] > 0.0 || weighted[i] == 0.0);
        let mut nearest;
        if flat && rest <= 1.0 {
            tau = 0.0;
            nearest = Vec3::from_fn(|i, _| {
                if shift[i] > 0.0 {
                    a[i] * (a[i] * y[i] / shift[i])
                } else {
                    0.0
                }
            });
            nearest[least] = a[least] * (1.0 - rest).max(0.0).sqrt();
        } else {
            for _ in 0..ROUNDS {
                let (mut sum, mut slope) = (-1.0, 0.0);
                for i in 0..3 {
                    if weighted[i] > 0.0 {
                        let ratio = weighted[i] / (tau + shift[i]);
                        sum += ratio * ratio;
                        slope += 2.0 * ratio * ratio / (tau + shift[i]);
                    }
                }
                let next = tau + sum / slope;
                if next <= tau || next.is_nan() {
                    break;
                }
                tau = next;
            }
            nearest = Vec3::from_fn(|i, _| {
                if weighted[i] > 0.0 {
                    a[i] * (a[i] * y[i] / (tau + shift[i]))
                } else {
                    0.0
                }
            });
        }
        let outward = nearest.component_div(a).component_div(a);
        let steepness = outward.norm();
        let normal = outward / steepness;
        let distance = (tau - a[least] * a[least]) * steepness;
        // Curvature of the surface, then that of the parallel surface through y.
        let flatten = across(&normal);
        let inverse_squares = Mat3::from_diagonal(&a.map(|x| 1.0 / (x * x)));
        let curvature = flatten * inverse_squares * flatten / steepness;
        let hessian = (Mat3::identity() + distance * curvature)
            .try_inverse()
            .map(|m| m * curvature)
            .filter(|m| m.iter().all(|x| x.is_finite()))
            .unwrap_or(Mat3::zeros());
        Field {
            distance,
            gradient: normal,
            hessian,
        }
    }

    /// Where an edge comes nearest in the frame in which the ellipsoid is the unit ball.
    fn approach(&self, from: &Vec3, along: &Vec3, length: f64) -> Approach {
        let start = from.component_div(&self.semi_axes);
        let step = along.component_div(&self.semi_axes);
        let at = (-start.dot(&step) / step.norm_squared()).clamp(0.0, length);
        let radii = (start + at * step).norm();
        Approach {
            at,
            least: self.semi_axes.min() * (radii - 1.0),
            pierced: radii < 1.0,
        }
    }

    /// A point so many radii from the centre is at least that far away.
    fn least(&self, x: &Vec3) -> f64 {
        self.semi_axes.min() * (x.component_div(&self.semi_axes).norm() - 1.0)
    }
}
