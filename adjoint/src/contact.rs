//! Compliant contact with friction at one point: a convex potential of the relative velocity.
//!
//! With the outward normal n (from the second body to the first), the relative velocity u at the point, its parts
//! v_n = n·u and v_t = u − n v_n, friction μ regularised over the speed v_s, and the horizon τ over which the gap is foreseen:
//!
//! ```text
//! σ = √(|v_t|² + v_s²)                    z = v_n − μ (σ − v_s)
//! N = weight · k · s(g₀ − φ − τ z) · s_d(1 − d z)
//! F = N (n − μ v_t/σ)   on the first body, −F on the second
//! ```
//!
//! s is the positive part, smoothed over ± the width: zero below −width, so that nothing acts at a distance beyond it. N falls as
//! z grows, so F = −∂P(z)/∂u of a potential P that is convex in u, and an implicit step in the end-of-step velocity is a convex
//! problem. |F_t| ≤ μ N at any speed. As in other convex models of friction, sliding acts as an approach: at the sliding
//! speed v the surfaces ride τ μ v apart.
//!
//! # References
//! A. Castro et al., "An Unconstrained Convex Formulation of Compliant Contact", 2022, and "A Theory of Irrotational Contact
//! Fields", 2023; dissipation after K. H. Hunt and F. R. E. Crossley, 1975.

use crate::lie::{Mat3, Vec3};

/// Constants of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// k, N/m for each point.
    pub stiffness: f64,
    /// d, s/m: the force is zero at separating speeds above 1/d.
    pub dissipation: f64,
    /// μ.
    pub friction: f64,
    /// v_s, m/s: friction holds with creep below about this speed.
    pub stiction_speed: f64,
    /// g₀, m: the gap at which the surfaces are taken to touch.
    pub gap: f64,
    /// Half the width over which the force sets in, m.
    pub width: f64,
    /// τ, s: how far ahead the gap is foreseen.
    pub horizon: f64,
}

/// State of a contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointState {
    /// φ, m.
    pub gap: f64,
    /// Share of the point's stiffness.
    pub weight: f64,
    /// n, unit, from the second body to the first.
    pub normal: Vec3,
    /// u, m/s: velocity of the first body there less the second's.
    pub velocity: Vec3,
}

/// Cotangents of a contact's arguments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactBar {
    /// Of the gap.
    pub gap: f64,
    /// Of the weight.
    pub weight: f64,
    /// Of the normal, free in all three directions.
    pub normal: Vec3,
    /// Of the relative velocity.
    pub velocity: Vec3,
    /// Of the stiffness.
    pub stiffness: f64,
    /// Of the dissipation.
    pub dissipation: f64,
    /// Of the friction coefficient.
    pub friction: f64,
}

/// Width of the smoothed positive part of 1 − d z.
const DAMPED: f64 = 0.1;

/// Positive part of `x`, smoothed over ± `width`, with its derivative: once continuously differentiable.
pub fn positive(x: f64, width: f64) -> (f64, f64) {
    if x <= -width {
        (0.0, 0.0)
    } else if x >= width {
        (x, 1.0)
    } else {
        let t = x + width;
        (t * t / (4.0 * width), t / (2.0 * width))
    }
}

/// What value and derivatives share.
struct Parts {
    tangential: Vec3,
    /// σ.
    speed: f64,
    /// z.
    approach: f64,
    /// s and its derivative.
    depth: (f64, f64),
    /// s_d and its derivative.
    damping: (f64, f64),
    /// n − μ v_t/σ.
    direction: Vec3,
}

impl Parts {
    fn new(law: &Law, m: &PointState) -> Self {
        let normal_speed = m.normal.dot(&m.velocity);
        let tangential = m.velocity - m.normal * normal_speed;
        let speed = tangential.norm_squared() + law.stiction_speed * law.stiction_speed;
        let speed = speed.sqrt();
        let approach = normal_speed - law.friction * (speed - law.stiction_speed);
        Self {
            tangential,
            speed,
            approach,
            depth: positive(law.gap - m.gap - law.horizon * approach, law.width),
            damping: positive(1.0 - law.dissipation * approach, DAMPED),
            direction: m.normal - tangential * (law.friction / speed),
        }
    }

    /// N per weight.
    fn normal_force(&self, law: &Law) -> f64 {
        law.stiffness * self.depth.0 * self.damping.0
    }

    /// ∂N/∂z per weight.
    fn slope(&self, law: &Law) -> f64 {
        -law.stiffness
            * (law.horizon * self.depth.1 * self.damping.0
                + law.dissipation * self.depth.0 * self.damping.1)
    }

    /// ∂(v_t/σ)/∂v_t within the tangent plane, all three directions.
    fn direction_slope(&self) -> Mat3 {
        let along = self.tangential / self.speed;
        (Mat3::identity() - along * along.transpose()) / self.speed
    }
}

/// F on the first body, N.
pub fn contact_force(law: &Law, m: &PointState) -> Vec3 {
    let p = Parts::new(law, m);
    p.direction * (m.weight * p.normal_force(law))
}

/// ∂F/∂u: symmetric and negative semi-definite, −∂²P/∂u².
pub fn contact_damping(law: &Law, m: &PointState) -> Mat3 {
    let p = Parts::new(law, m);
    let plane = Mat3::identity() - m.normal * m.normal.transpose();
    let e = &p.direction;
    let along = p.slope(law) * e * e.transpose();
    let across = p.normal_force(law) * law.friction * (plane * p.direction_slope() * plane);
    m.weight * (along - across)
}

/// Tangent of [`contact_force`] along a change of the velocity.
pub fn contact_force_jvp(law: &Law, m: &PointState, velocity: &Vec3) -> Vec3 {
    contact_damping(law, m) * velocity
}

/// Transpose of [`contact_force`] in all its arguments.
pub fn contact_force_vjp(law: &Law, m: &PointState, bar: &Vec3) -> ContactBar {
    let p = Parts::new(law, m);
    let force = p.normal_force(law);
    let (n, u) = (&m.normal, &m.velocity);
    let along = p.direction.dot(bar);
    // F = weight N e: cotangents of N, of e, and through them of z, s, s_d and v_t.
    let force_bar = m.weight * along;
    let e_bar = bar * (m.weight * force);
    let depth_bar = force_bar * law.stiffness * p.damping.0 * p.depth.1;
    let damping_bar = force_bar * law.stiffness * p.depth.0 * p.damping.1;
    let z_bar = -law.horizon * depth_bar - law.dissipation * damping_bar;
    let t = p.tangential;
    let t_bar =
        -law.friction * (p.direction_slope() * e_bar) - t * (law.friction * z_bar / p.speed);
    // v_n = n·u, v_t = u − n v_n.
    let normal_speed_bar = z_bar - n.dot(&t_bar);
    ContactBar {
        gap: -depth_bar,
        weight: along * force,
        normal: e_bar - t_bar * n.dot(u) + u * normal_speed_bar,
        velocity: t_bar + n * normal_speed_bar,
        stiffness: force_bar * p.depth.0 * p.damping.0,
        dissipation: -p.approach * damping_bar,
        friction: -t.dot(&e_bar) / p.speed - z_bar * (p.speed - law.stiction_speed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> Law {
        Law {
            stiffness: 2e4,
            dissipation: 0.7,
            friction: 0.65,
            stiction_speed: 1e-3,
            gap: 2e-3,
            width: 1e-4,
            horizon: 0.01,
        }
    }

    fn point_state(gap: f64, velocity: Vec3) -> PointState {
        PointState {
            gap,
            weight: 1.0,
            normal: Vec3::new(0.36, -0.48, 0.8),
            velocity,
        }
    }

    /// Nothing beyond the width, friction inside its cone, and never work done on the bodies by friction.
    #[test]
    fn forces_stay_in_the_cone() {
        let law = law();
        for k in 0..2000 {
            let x = f64::from(k);
            let velocity = Vec3::new((7.1 * x).sin(), (3.3 * x).cos(), (1.7 * x).sin());
            let m = point_state(law.gap + 0.01 * (0.37 * x).sin(), velocity);
            let f = contact_force(&law, &m);
            let normal = f.dot(&m.normal);
            let tangential = f - m.normal * normal;
            assert!(normal >= 0.0 && tangential.norm() <= law.friction * normal * (1.0 + 1e-12));
            assert!(tangential.dot(&m.velocity) <= 0.0);
            let known = Parts::new(&law, &m).normal_force(&law);
            assert!((normal - known).abs() <= 1e-12 * normal);
            let foreseen = law.gap - m.gap - law.horizon * Parts::new(&law, &m).approach;
            assert_eq!(
                normal > 0.0,
                foreseen > -law.width && m.velocity.norm() < 1e3 && {
                    1.0 - law.dissipation * Parts::new(&law, &m).approach > -DAMPED
                }
            );
        }
    }

    #[test]
    fn damping_is_symmetric_and_dissipates() {
        let law = law();
        for k in 0..200 {
            let x = f64::from(k);
            let velocity = 1e-3 * Vec3::new((7.1 * x).sin(), (3.3 * x).cos(), (1.7 * x).sin());
            let d = contact_damping(&law, &point_state(1.99e-3, velocity));
            assert!((d - d.transpose()).norm() <= 1e-12 * d.norm());
            assert!(d.symmetric_eigenvalues().max() <= 1e-12 * d.norm());
        }
    }

    /// At rest, at exact touch, and without stiffness: finite.
    #[test]
    fn zero_velocity_and_exact_touch_are_finite() {
        let law = law();
        for gap in [law.gap, law.gap + law.width, law.gap - law.width, 0.0] {
            let m = point_state(gap, Vec3::zeros());
            let bar = contact_force_vjp(&law, &m, &Vec3::new(1.0, 2.0, 3.0));
            let all = [
                bar.gap,
                bar.weight,
                bar.stiffness,
                bar.dissipation,
                bar.friction,
            ];
            assert!(all.iter().all(|x| x.is_finite()));
            assert!(
                bar.normal
                    .iter()
                    .chain(bar.velocity.iter())
                    .all(|x| x.is_finite())
            );
            assert!(contact_force(&law, &m).iter().all(|x| x.is_finite()));
        }
    }
}
