//! Joints: motion, velocity maps and their derivatives, one joint at a time.
//!
//! Every joint's motions form a subgroup of the rigid motions, with a constant basis of twists
//! `B` in the joint's own frame ([`Joint::basis`]). Two velocity coordinates are used:
//! - the user's `v`: rates of translation of the body's origin, and the angular velocity;
//! - the *frame* velocity `v̂ = X(q) v`: coefficients of the body's twist about the joint frame's
//!   origin on `B`. Its dual, the frame momentum `p̂ = X⁻ᵀ p`, is what a joint to the world conserves:
//!   for a free body momentum and angular momentum about the world origin.
//!
//! `X` differs from the identity for planar and free joints only.

use crate::adjoint::lie::{self, Mat3, Pose, Vec3, Vec6};
use nalgebra::{Quaternion, UnitQuaternion};

/// A joint with its axes normalised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Joint {
    /// No motion.
    Fixed,
    /// Translation along a unit axis.
    Prismatic(Vec3),
    /// Rotation about a unit axis through the frame's origin.
    Revolute(Vec3),
    /// Translations along the first two columns, then rotation about the third (right-handed).
    Planar(Mat3),
    /// Rotation about the frame's origin.
    Spherical,
    /// Any rigid motion.
    Free,
}

fn quaternion(q: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
}

fn vec3(x: &[f64]) -> Vec3 {
    Vec3::new(x[0], x[1], x[2])
}

impl Joint {
    /// Number of coordinates q.
    pub fn coordinates(&self) -> usize {
        match self {
            Joint::Fixed => 0,
            Joint::Prismatic(_) | Joint::Revolute(_) => 1,
            Joint::Planar(_) => 3,
            Joint::Spherical => 4,
            Joint::Free => 7,
        }
    }

    /// Number of generalised velocities v.
    pub fn velocities(&self) -> usize {
        match self {
            Joint::Fixed => 0,
            Joint::Prismatic(_) | Joint::Revolute(_) => 1,
            Joint::Planar(_) | Joint::Spherical => 3,
            Joint::Free => 6,
        }
    }

    /// Coordinates of no motion.
    pub fn origin(&self) -> Vec<f64> {
        match self {
            Joint::Spherical => vec![1.0, 0.0, 0.0, 0.0],
            Joint::Free => vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            _ => vec![0.0; self.coordinates()],
        }
    }

    /// Basis of the joint's twists about its frame's origin, constant.
    pub fn basis(&self) -> Vec<Vec6> {
        let zero = Vec3::zeros();
        match self {
            Joint::Fixed => vec![],
            Joint::Prismatic(axis) => vec![lie::six(axis, &zero)],
            Joint::Revolute(axis) => vec![lie::six(&zero, axis)],
            Joint::Planar(axes) => vec![
                lie::six(&axes.column(0).into_owned(), &zero),
                lie::six(&axes.column(1).into_owned(), &zero),
                lie::six(&zero, &axes.column(2).into_owned()),
            ],
            Joint::Spherical => (3..6).map(|k| Vec6::ith(k, 1.0)).collect(),
            Joint::Free => (0..6).map(|k| Vec6::ith(k, 1.0)).collect(),
        }
    }

    /// Pose of the body in the joint's frame at coordinates `q`.
    pub fn pose(&self, q: &[f64]) -> Pose {
        match self {
            Joint::Fixed => Pose::identity(),
            Joint::Prismatic(axis) => Pose::new(Mat3::identity(), q[0] * axis),
            Joint::Revolute(axis) => Pose::new(lie::exp_matrix(&(q[0] * axis)), Vec3::zeros()),
            Joint::Planar(axes) => Pose::new(
                lie::exp_matrix(&(q[2] * axes.column(2))),
                q[0] * axes.column(0) + q[1] * axes.column(1),
            ),
            Joint::Spherical => Pose::new(
                quaternion(q).to_rotation_matrix().into_inner(),
                Vec3::zeros(),
            ),
            Joint::Free => Pose::new(
                quaternion(&q[3..7]).to_rotation_matrix().into_inner(),
                vec3(&q[0..3]),
            ),
        }
    }

    /// Coordinates after a finite tangent displacement: translations add, rotations turn by
    /// `exp` on the left, in the joint's frame.
    pub fn integrate(&self, q: &[f64], xi: &[f64]) -> Vec<f64> {
        let turned = |q: &[f64], theta: &[f64]| {
            // Renormalised, so that rounding over many steps can't leave the unit sphere.
            let r = (lie::exp(&vec3(theta)).quaternion() * quaternion(q).quaternion()).normalize();
            [r.w, r.i, r.j, r.k]
        };
        match self {
            Joint::Spherical => turned(q, xi).to_vec(),
            Joint::Free => {
                let mut out: Vec<f64> = (0..3).map(|k| q[k] + xi[k]).collect();
                out.extend(turned(&q[3..7], &xi[3..6]));
                out
            }
            _ => q.iter().zip(xi).map(|(q, x)| q + x).collect(),
        }
    }

    /// Cotangents of `(q, xi)` from the tangent cotangent of [`Joint::integrate`]'s result.
    pub fn integrate_vjp(&self, xi: &[f64], out_bar: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let rotation = |xi: &[f64], bar: &[f64]| {
            let (theta, bar) = (vec3(xi), vec3(bar));
            (
                lie::exp_matrix(&theta).tr_mul(&bar),
                lie::exp_jacobian(&theta).tr_mul(&bar),
            )
        };
        match self {
            Joint::Spherical => {
                let (q_bar, xi_bar) = rotation(xi, out_bar);
                (q_bar.as_slice().to_vec(), xi_bar.as_slice().to_vec())
            }
            Joint::Free => {
                let (q_ang, xi_ang) = rotation(&xi[3..6], &out_bar[3..6]);
                let join = |a: &Vec3| {
                    let mut x = out_bar[0..3].to_vec();
                    x.extend_from_slice(a.as_slice());
                    x
                };
                (join(&q_ang), join(&xi_ang))
            }
            _ => (out_bar.to_vec(), out_bar.to_vec()),
        }
    }

    /// Rate of the chart coordinates `xi` (where `q = q₀ ⊕ xi`) at generalised velocity `v`.
    pub fn chart_rate(&self, xi: &[f64], v: &[f64]) -> Vec<f64> {
        let rate = |xi: &[f64], w: &[f64]| lie::exp_jacobian_inverse(&vec3(xi)) * vec3(w);
        match self {
            Joint::Spherical => rate(xi, v).as_slice().to_vec(),
            Joint::Free => {
                let mut out = v[0..3].to_vec();
                out.extend_from_slice(rate(&xi[3..6], &v[3..6]).as_slice());
                out
            }
            _ => v.to_vec(),
        }
    }

    /// Cotangents of `(xi, v)` of [`Joint::chart_rate`].
    pub fn chart_rate_vjp(&self, xi: &[f64], v: &[f64], bar: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let rotation = |xi: &[f64], w: &[f64], bar: &[f64]| {
            let (theta, w, bar) = (vec3(xi), vec3(w), vec3(bar));
            (
                lie::exp_jacobian_inverse_vjp(&theta, &w, &bar),
                lie::exp_jacobian_inverse(&theta).tr_mul(&bar),
            )
        };
        match self {
            Joint::Spherical => {
                let (x, w) = rotation(xi, v, bar);
                (x.as_slice().to_vec(), w.as_slice().to_vec())
            }
            Joint::Free => {
                let (x, w) = rotation(&xi[3..6], &v[3..6], &bar[3..6]);
                let mut xi_bar = vec![0.0; 3];
                xi_bar.extend_from_slice(x.as_slice());
                let mut v_bar = bar[0..3].to_vec();
                v_bar.extend_from_slice(w.as_slice());
                (xi_bar, v_bar)
            }
            _ => (vec![0.0; xi.len()], bar.to_vec()),
        }
    }

    /// Frame velocity `v̂ = X(q) v`.
    pub fn frame_velocity(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![v[0] + v[2] * q[1], v[1] - v[2] * q[0], v[2]],
            Joint::Free => {
                let lin = vec3(v) + vec3(q).cross(&vec3(&v[3..6]));
                vec![lin.x, lin.y, lin.z, v[3], v[4], v[5]]
            }
            _ => v.to_vec(),
        }
    }

    /// `v = X(q)⁻¹ v̂`.
    pub fn frame_velocity_inverse(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![hat[0] - hat[2] * q[1], hat[1] + hat[2] * q[0], hat[2]],
            Joint::Free => {
                let lin = vec3(hat) - vec3(q).cross(&vec3(&hat[3..6]));
                vec![lin.x, lin.y, lin.z, hat[3], hat[4], hat[5]]
            }
            _ => hat.to_vec(),
        }
    }

    /// Generalised momentum or force `p = X(q)ᵀ p̂`.
    pub fn frame_momentum_transpose(&self, q: &[f64], hat: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![hat[0], hat[1], hat[2] + q[1] * hat[0] - q[0] * hat[1]],
            Joint::Free => {
                let ang = vec3(&hat[3..6]) - vec3(q).cross(&vec3(hat));
                vec![hat[0], hat[1], hat[2], ang.x, ang.y, ang.z]
            }
            _ => hat.to_vec(),
        }
    }

    /// Frame momentum or force `p̂ = X(q)⁻ᵀ p`.
    pub fn frame_momentum(&self, q: &[f64], p: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![p[0], p[1], p[2] - q[1] * p[0] + q[0] * p[1]],
            Joint::Free => {
                let ang = vec3(&p[3..6]) + vec3(q).cross(&vec3(p));
                vec![p[0], p[1], p[2], ang.x, ang.y, ang.z]
            }
            _ => p.to_vec(),
        }
    }

    /// Place of the angular velocity among the velocities, where the joint turns by a rotation vector.
    fn turning(&self) -> Option<usize> {
        match self {
            Joint::Spherical => Some(0),
            Joint::Free => Some(3),
            _ => None,
        }
    }

    /// Applies a 3 × 3 matrix of the rotation vector in `xi` to the angular part of `x`.
    fn turn(&self, xi: &[f64], x: &mut [f64], map: impl Fn(&Vec3) -> Mat3) {
        if let Some(at) = self.turning() {
            let y = map(&vec3(&xi[at..at + 3])) * vec3(&x[at..at + 3]);
            x[at..at + 3].copy_from_slice(y.as_slice());
        }
    }

    /// Momentum conjugate to the chart coordinates `xi` at `q ⊕ xi`: `J(xi)ᵀ X(q ⊕ xi)ᵀ p̂`, with `v = J ẋi`.
    pub fn chart_momentum(&self, q: &[f64], xi: &[f64], hat: &[f64]) -> Vec<f64> {
        let mut p = self.frame_momentum_transpose(&self.integrate(q, xi), hat);
        self.turn(xi, &mut p, |theta| lie::exp_jacobian(theta).transpose());
        p
    }

    /// Cotangents of `(q, xi, p̂)` of [`Joint::chart_momentum`] for the cotangent `z`.
    pub fn chart_momentum_vjp(
        &self,
        q: &[f64],
        xi: &[f64],
        hat: &[f64],
        z: &[f64],
    ) -> [Vec<f64>; 3] {
        let next = self.integrate(q, xi);
        let mut turned = z.to_vec();
        self.turn(xi, &mut turned, lie::exp_jacobian);
        // X depends on translations only, which add.
        let q_bar = self.frame_velocity_vjp(&turned, hat);
        let mut xi_bar = q_bar.clone();
        if let Some(at) = self.turning() {
            // dJ = −J d(J⁻¹) J.
            let conjugate = self.chart_momentum(q, xi, hat);
            let part = |x: &[f64]| vec3(&x[at..at + 3]);
            let bar = -lie::exp_jacobian_inverse_vjp(&part(xi), &part(&turned), &part(&conjugate));
            for k in 0..3 {
                xi_bar[at + k] += bar[k];
            }
        }
        [q_bar, xi_bar, self.frame_velocity(&next, &turned)]
    }

    /// Tangent cotangent of `q` from `v̂̄` of [`Joint::frame_velocity`]: the gradient of
    /// `v̂̄ · X(q) v`. The gradient of `v̂ᵀ X⁻ᵀ p` (see [`Joint::frame_momentum`]) is its negative with
    /// `X⁻¹ v̂` as velocity and `X⁻ᵀ p` as cotangent.
    pub fn frame_velocity_vjp(&self, v: &[f64], hat_bar: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![-v[2] * hat_bar[1], v[2] * hat_bar[0], 0.0],
            Joint::Free => {
                let c = vec3(&v[3..6]).cross(&vec3(hat_bar));
                vec![c.x, c.y, c.z, 0.0, 0.0, 0.0]
            }
            _ => vec![0.0; self.velocities()],
        }
    }

    /// Rate of the frame velocity at constant `v`: `Ẋ v` along `v` itself.
    pub fn frame_bias(&self, v: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![v[2] * v[1], -v[2] * v[0], 0.0],
            Joint::Free => {
                let c = vec3(v).cross(&vec3(&v[3..6]));
                vec![c.x, c.y, c.z, 0.0, 0.0, 0.0]
            }
            _ => vec![0.0; self.velocities()],
        }
    }

    /// Cotangent of `v` of [`Joint::frame_bias`].
    pub fn frame_bias_vjp(&self, v: &[f64], bar: &[f64]) -> Vec<f64> {
        match self {
            Joint::Planar(_) => vec![-v[2] * bar[1], v[2] * bar[0], v[1] * bar[0] - v[0] * bar[1]],
            Joint::Free => {
                let (u, w, b) = (vec3(v), vec3(&v[3..6]), vec3(bar));
                let (ub, wb) = (w.cross(&b), b.cross(&u));
                vec![ub.x, ub.y, ub.z, wb.x, wb.y, wb.z]
            }
            _ => vec![0.0; self.velocities()],
        }
    }
}
