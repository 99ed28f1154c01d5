//! Motion, velocity maps and their derivatives, one joint at a time.
//!
//! Two velocity coordinates are used:
//! - the user's `v`: rates of translation of the body's origin, and the angular velocity;
//! - the *frame* velocity `v̂ = X(q) v`: coefficients of the body's twist about the joint frame's
//!   origin on the constant basis of the joint's twists ([`JointMotion::basis`]). Its dual, the frame momentum `p̂ = X⁻ᵀ p`,
//!   is what a joint to the world conserves: for a free body momentum and angular momentum about the world origin.
//!
//! `X` differs from the identity where translation and rotation are coordinates of one joint: for planar and free joints.

use super::JointMotion;
use crate::adjoint::lie::{self, Mat3, Vec3};
use nalgebra::{Quaternion, UnitQuaternion};
use std::ops::Deref;
use std::sync::Arc;

/// A joint that moves: what all joints do with their own [`JointMotion`]. Clones share it.
#[derive(Clone, Debug)]
pub struct JointModel(Arc<dyn JointMotion>);

pub(super) fn quaternion(q: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
}

pub(super) fn vec3(x: &[f64]) -> Vec3 {
    Vec3::new(x[0], x[1], x[2])
}

impl Deref for JointModel {
    type Target = dyn JointMotion;

    fn deref(&self) -> &Self::Target {
        self.0.as_ref()
    }
}

impl JointModel {
    /// A joint with these motions.
    pub fn new(motion: impl JointMotion) -> Self {
        Self(Arc::new(motion))
    }

    /// Number of coordinates q.
    pub fn coordinates(&self) -> usize {
        self.coordinate_labels().len()
    }

    /// Number of generalised velocities v.
    pub fn velocities(&self) -> usize {
        self.velocity_labels().len()
    }

    /// Coordinates of no motion: zero, with an identity quaternion.
    pub fn origin(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.coordinates()];
        if let Some(w) = self.quaternion_at() {
            q[w] = 1.0;
        }
        q
    }

    /// Whether it lets the body move anyhow.
    pub fn is_free(&self) -> bool {
        self.velocities() == 6
    }

    /// Coordinates after a finite tangent displacement: plain ones add, rotations are multiplied by
    /// `exp` on the left, in the joint's frame.
    pub fn integrate(&self, q: &[f64], xi: &[f64]) -> Vec<f64> {
        let add =
            |q: &[f64], xi: &[f64]| -> Vec<f64> { q.iter().zip(xi).map(|(q, x)| q + x).collect() };
        let Some(at) = self.quaternion_at() else {
            return add(q, xi);
        };
        let mut out = add(&q[..at], &xi[..at]);
        // Renormalised, so that rounding over many steps can't leave the unit sphere.
        let theta = lie::exp(&vec3(&xi[at..]));
        let r = (theta.quaternion() * quaternion(&q[at..]).quaternion()).normalize();
        out.extend([r.w, r.i, r.j, r.k]);
        out
    }

    /// The displacement with which [`JointModel::integrate`] gets `from` one to the other; of rotations the shorter way.
    pub fn difference(&self, from: &[f64], to: &[f64]) -> Vec<f64> {
        let plain = self.quaternion_at().unwrap_or(from.len());
        let mut out: Vec<f64> = from[..plain].iter().zip(to).map(|(a, b)| b - a).collect();
        if let Some(at) = self.quaternion_at() {
            let turned = quaternion(&to[at..]) * quaternion(&from[at..]).inverse();
            out.extend(turned.scaled_axis().iter());
        }
        out
    }

    /// Cotangents of `(q, xi)` from the tangent cotangent of [`JointModel::integrate`]'s result.
    pub fn integrate_vjp(&self, xi: &[f64], out_bar: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut q_bar, mut xi_bar) = (out_bar.to_vec(), out_bar.to_vec());
        self.rotate(xi, &mut q_bar, |theta| lie::exp_matrix(theta).transpose());
        self.rotate(xi, &mut xi_bar, |theta| {
            lie::exp_jacobian(theta).transpose()
        });
        (q_bar, xi_bar)
    }

    /// Rate of the chart coordinates `xi` (where `q = q₀ ⊕ xi`) at generalised velocity `v`.
    pub fn chart_rate(&self, xi: &[f64], v: &[f64]) -> Vec<f64> {
        let mut out = v.to_vec();
        self.rotate(xi, &mut out, lie::exp_jacobian_inverse);
        out
    }

    /// Cotangents of `(xi, v)` of [`JointModel::chart_rate`].
    pub fn chart_rate_vjp(&self, xi: &[f64], v: &[f64], bar: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut xi_bar, mut v_bar) = (vec![0.0; xi.len()], bar.to_vec());
        self.rotate(xi, &mut v_bar, |theta| {
            lie::exp_jacobian_inverse(theta).transpose()
        });
        if let Some(at) = self.quaternion_at() {
            let part = |x: &[f64]| vec3(&x[at..at + 3]);
            let x = lie::exp_jacobian_inverse_vjp(&part(xi), &part(v), &part(bar));
            xi_bar[at..at + 3].copy_from_slice(x.as_slice());
        }
        (xi_bar, v_bar)
    }

    /// Applies a 3 × 3 matrix of the rotation vector in `xi` to the angular part of `x`.
    fn rotate(&self, xi: &[f64], x: &mut [f64], map: impl Fn(&Vec3) -> Mat3) {
        if let Some(at) = self.quaternion_at() {
            let y = map(&vec3(&xi[at..at + 3])) * vec3(&x[at..at + 3]);
            x[at..at + 3].copy_from_slice(y.as_slice());
        }
    }

    /// Momentum conjugate to the chart coordinates `xi` at `q ⊕ xi`: `J(xi)ᵀ X(q ⊕ xi)ᵀ p̂`, with `v = J ẋi`.
    pub fn chart_momentum(&self, q: &[f64], xi: &[f64], hat: &[f64]) -> Vec<f64> {
        let mut p = self.frame_momentum_transpose(&self.integrate(q, xi), hat);
        self.rotate(xi, &mut p, |theta| lie::exp_jacobian(theta).transpose());
        p
    }

    /// Cotangents of `(q, xi, p̂)` of [`JointModel::chart_momentum`] for the cotangent `z`.
    pub fn chart_momentum_vjp(
        &self,
        q: &[f64],
        xi: &[f64],
        hat: &[f64],
        z: &[f64],
    ) -> [Vec<f64>; 3] {
        let next = self.integrate(q, xi);
        let mut rotated = z.to_vec();
        self.rotate(xi, &mut rotated, lie::exp_jacobian);
        // X depends on translations only, which add.
        let q_bar = self.frame_velocity_vjp(&rotated, hat);
        let mut xi_bar = q_bar.clone();
        if let Some(at) = self.quaternion_at() {
            // dJ = −J d(J⁻¹) J.
            let conjugate = self.chart_momentum(q, xi, hat);
            let part = |x: &[f64]| vec3(&x[at..at + 3]);
            let bar = -lie::exp_jacobian_inverse_vjp(&part(xi), &part(&rotated), &part(&conjugate));
            for k in 0..3 {
                xi_bar[at + k] += bar[k];
            }
        }
        [q_bar, xi_bar, self.frame_velocity(&next, &rotated)]
    }
}
