//! Poses and their adjoint action on twists and wrenches.

use super::{Mat3, Vec3, Vec6, angular, linear, six};

/// A rigid placement, `x_world = rotation · x_body + translation` (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation matrix, body to world.
    pub rotation: Mat3,
    /// Position of the body's origin in the world, m.
    pub translation: Vec3,
}

impl Pose {
    /// No rotation, no translation.
    pub fn identity() -> Self {
        Self {
            rotation: Mat3::identity(),
            translation: Vec3::zeros(),
        }
    }

    /// From its parts.
    pub fn new(rotation: Mat3, translation: Vec3) -> Self {
        Self {
            rotation,
            translation,
        }
    }

    /// A body point in the world.
    #[inline]
    pub fn apply(&self, x: &Vec3) -> Vec3 {
        self.rotation * x + self.translation
    }

    /// A world point in the body.
    #[inline]
    pub fn apply_inverse(&self, x: &Vec3) -> Vec3 {
        self.rotation.tr_mul(&(x - self.translation))
    }

    /// `self ∘ inner`: first `inner`, then `self`.
    pub fn compose(&self, inner: &Pose) -> Pose {
        Pose::new(
            self.rotation * inner.rotation,
            self.apply(&inner.translation),
        )
    }

    /// The inverse placement.
    pub fn inverse(&self) -> Pose {
        let rotation = self.rotation.transpose();
        Pose::new(rotation, -(rotation * self.translation))
    }

    /// Moves the pose by the finite spatial displacement `exp(z)`, z = (δt-field, δθ).
    pub fn displace(&self, z: &Vec6) -> Pose {
        let (u, w) = (linear(z), angular(z));
        let rotation = super::exp_matrix(&w);
        let shift = super::exp_jacobian(&w) * u;
        Pose::new(
            rotation * self.rotation,
            rotation * self.translation + shift,
        )
    }

    /// Spatial twist (about the world origin) of a twist given in this frame about its origin.
    #[inline]
    pub fn twist_to_world(&self, v: &Vec6) -> Vec6 {
        let w = self.rotation * angular(v);
        six(
            &(self.rotation * linear(v) + self.translation.cross(&w)),
            &w,
        )
    }

    /// Inverse of [`Pose::twist_to_world`].
    #[inline]
    pub fn twist_to_body(&self, v: &Vec6) -> Vec6 {
        let (u, w) = (linear(v), angular(v));
        six(
            &self.rotation.tr_mul(&(u - self.translation.cross(&w))),
            &self.rotation.tr_mul(&w),
        )
    }

    /// Spatial wrench (moment about the world origin) of a wrench or momentum given in this frame
    /// about its origin. `wrench_to_world(f) · v = f · twist_to_body(v)`.
    #[inline]
    pub fn wrench_to_world(&self, f: &Vec6) -> Vec6 {
        let force = self.rotation * linear(f);
        six(
            &force,
            &(self.rotation * angular(f) + self.translation.cross(&force)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::{cross_force, cross_motion, exp_matrix};
    use super::*;

    fn pose() -> Pose {
        Pose::new(
            exp_matrix(&Vec3::new(0.3, -0.7, 1.1)),
            Vec3::new(0.4, 2.0, -1.0),
        )
    }

    #[test]
    fn twists_and_wrenches_keep_power_and_come_back() {
        let g = pose();
        let v = Vec6::new(1.0, -2.0, 0.5, 0.3, 0.8, -0.6);
        let f = Vec6::new(-0.2, 0.9, 1.5, 2.0, -0.4, 0.7);
        assert!((g.twist_to_body(&g.twist_to_world(&v)) - v).norm() < 1e-14);
        assert!((g.inverse().wrench_to_world(&g.wrench_to_world(&f)) - f).norm() < 1e-14);
        assert!((g.wrench_to_world(&f).dot(&g.twist_to_world(&v)) - f.dot(&v)).abs() < 1e-14);
        assert!((cross_motion(&v, &f).dot(&f) + f.dot(&cross_force(&v, &f))).abs() < 1e-14);
    }

    #[test]
    fn displacement_moves_twists_by_the_bracket() {
        let g = pose();
        let z = Vec6::new(0.2, 0.1, -0.4, 0.6, -0.3, 0.5);
        let v = Vec6::new(1.0, -2.0, 0.5, 0.3, 0.8, -0.6);
        let h = 1e-5;
        let moved = (g.displace(&(h * z)).twist_to_world(&v)
            - g.displace(&(-h * z)).twist_to_world(&v))
            / (2.0 * h);
        assert!((moved - cross_motion(&z, &g.twist_to_world(&v))).norm() < 1e-9);
    }
}
