//! Compliant contact with friction at one point: a convex potential of the relative velocity and spin.
//!
//! With the outward normal n (from the second body to the first), the relative velocity u at the point and the relative angular
//! velocity ω, their parts v_n = n·u and v_t = u − n v_n, ω_n = n·ω and ω_t = ω − n ω_n, friction μ regularised over the speed v_s,
//! torsional and rolling friction μ_t and μ_r (lengths) regularised over the angular speed ω_s, and the horizon τ over which the
//! gap is foreseen:
//!
//! ```text
//! σ = √(|v_t|² + v_s²)      σ_t = √(ω_n² + ω_s²)      σ_r = √(|ω_t|² + ω_s²)
//! S = μ (σ − v_s) + μ_t (σ_t − ω_s) + μ_r (σ_r − ω_s)
//! z = v_n − S
//! N = weight · k · s(g₀ − φ − τ z) · s_d(1 − d z)
//! F = N ∂z/∂u = N (n − μ v_t/σ)       T = N ∂z/∂ω = −N (μ_t n ω_n/σ_t + μ_r ω_t/σ_r)       on the first body, −F and −T on the second
//! ```
//!
//! s is the positive part, smoothed over ± the width: zero below −width, so that nothing acts at a distance beyond it. N falls as
//! z grows, and z is concave in u and ω, so F and T are the slopes −∂P(z) of a potential P that is convex in both, and an implicit
//! step in the end-of-step velocity is a convex problem. |F_t| ≤ μ N, |T_n| ≤ μ_t N and |T_t| ≤ μ_r N at any speed. As in other
//! convex models of friction, sliding acts as an approach: at the sliding speed v the surfaces ride τ μ v apart.
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
    /// μ_t, m: torque against spinning about the normal, per normal force.
    pub torsional_friction: f64,
    /// μ_r, m: torque against rolling, about axes across the normal, per normal force.
    pub rolling_friction: f64,
    /// v_s, m/s: friction holds with creep below about this speed.
    pub stiction_speed: f64,
    /// ω_s, rad/s: the same of torsional and rolling friction.
    pub stiction_spin: f64,
    /// g₀, m: the gap at which the surfaces are taken to touch.
    pub gap: f64,
    /// Half the width over which the force sets in, m.
    pub width: f64,
    /// τ, s: how far ahead the gap is foreseen.
    pub horizon: f64,
}

/// How the first body moves against the second at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// u, m/s: velocity of the first body there less the second's.
    pub velocity: Vec3,
    /// ω, rad/s: angular velocity of the first body less the second's.
    pub spin: Vec3,
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
    /// How the first body moves against the second there.
    pub rates: Rates,
}

/// What a contact does to the first body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// F, N, at the point.
    pub force: Vec3,
    /// T, N m.
    pub torque: Vec3,
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
    /// Of the relative motion.
    pub rates: Rates,
    /// Of the stiffness.
    pub stiffness: f64,
    /// Of the dissipation.
    pub dissipation: f64,
    /// Of the friction coefficient.
    pub friction: f64,
    /// Of torsional friction.
    pub torsional_friction: f64,
    /// Of rolling friction.
    pub rolling_friction: f64,
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

/// Motion at a point in its parts, and what of it rubs.
struct Slip {
    /// v_n.
    normal_speed: f64,
    /// v_t.
    tangential: Vec3,
    /// σ.
    speed: f64,
    /// ω_n.
    twist: f64,
    /// σ_t.
    twist_speed: f64,
    /// ω_t.
    roll: Vec3,
    /// σ_r.
    roll_speed: f64,
    /// S.
    total: f64,
}

/// Cotangents of a [`Slip`].
struct SlipBar {
    normal_speed: f64,
    tangential: Vec3,
    twist: f64,
    roll: Vec3,
    total: f64,
}

/// (I − a aᵀ)/s for a = x/s: the derivative of x/√(|x|² + s₀²).
fn turning(x: &Vec3, speed: f64) -> Mat3 {
    let along = x / speed;
    (Mat3::identity() - along * along.transpose()) / speed
}

impl Slip {
    fn new(law: &Law, normal: &Vec3, rates: &Rates) -> Self {
        let normal_speed = normal.dot(&rates.velocity);
        let tangential = rates.velocity - normal * normal_speed;
        let speed = tangential.norm_squared() + law.stiction_speed * law.stiction_speed;
        let speed = speed.sqrt();
        let twist = normal.dot(&rates.spin);
        let roll = rates.spin - normal * twist;
        let still = law.stiction_spin;
        let twist_speed = (twist * twist + still * still).sqrt();
        let roll_speed = (roll.norm_squared() + still * still).sqrt();
        Self {
            total: law.friction * (speed - law.stiction_speed)
                + law.torsional_friction * (twist_speed - still)
                + law.rolling_friction * (roll_speed - still),
            normal_speed,
            tangential,
            speed,
            twist,
            twist_speed,
            roll,
            roll_speed,
        }
    }

    /// Transpose of [`Slip::new`]: adds to `out` what belongs to the normal and the law, and gives the cotangent of the motion.
    fn vjp(
        &self,
        law: &Law,
        (normal, rates): (&Vec3, &Rates),
        bar: &SlipBar,
        out: &mut ContactBar,
    ) -> Rates {
        let total = bar.total;
        let t_bar = bar.tangential + self.tangential * (law.friction * total / self.speed);
        let twist = law.torsional_friction * total / self.twist_speed;
        let twist_bar = bar.twist + self.twist * twist;
        let roll = law.rolling_friction * total / self.roll_speed;
        let roll_bar = bar.roll + self.roll * roll;
        out.friction += total * (self.speed - law.stiction_speed);
        out.torsional_friction += total * (self.twist_speed - law.stiction_spin);
        out.rolling_friction += total * (self.roll_speed - law.stiction_spin);
        // v_n = n·u, v_t = u − n v_n; the spin alike.
        let along = bar.normal_speed - normal.dot(&t_bar);
        let about = twist_bar - normal.dot(&roll_bar);
        out.normal += rates.velocity * along - t_bar * self.normal_speed + rates.spin * about
            - roll_bar * self.twist;
        Rates {
            velocity: t_bar + normal * along,
            spin: roll_bar + normal * about,
        }
    }
}

/// What value and derivatives share.
struct Parts {
    slip: Slip,
    /// z.
    approach: f64,
    /// s and its derivative.
    depth: (f64, f64),
    /// s_d and its derivative.
    damping: (f64, f64),
    /// ∂z/∂u and ∂z/∂ω.
    direction: Push,
}

impl Parts {
    fn new(law: &Law, m: &PointState) -> Self {
        let slip = Slip::new(law, &m.normal, &m.rates);
        let approach = slip.normal_speed - slip.total;
        let about = m.normal * (law.torsional_friction * slip.twist / slip.twist_speed);
        let across = slip.roll * (law.rolling_friction / slip.roll_speed);
        Self {
            approach,
            depth: positive(law.gap - m.gap - law.horizon * approach, law.width),
            damping: positive(1.0 - law.dissipation * approach, DAMPED),
            direction: Push {
                force: m.normal - slip.tangential * (law.friction / slip.speed),
                torque: -(about + across),
            },
            slip,
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

    /// ∂(ω_n/σ_t)/∂ω_n.
    fn twist_slope(&self, law: &Law) -> f64 {
        law.stiction_spin * law.stiction_spin / self.slip.twist_speed.powi(3)
    }
}

/// F and T on the first body.
pub fn contact_force(law: &Law, m: &PointState) -> Push {
    let p = Parts::new(law, m);
    let force = m.weight * p.normal_force(law);
    Push {
        force: p.direction.force * force,
        torque: p.direction.torque * force,
    }
}

/// Tangent of [`contact_force`] along a change of the motion: −∂²P times it, symmetric and negative semi-definite.
pub fn contact_force_jvp(law: &Law, m: &PointState, along: &Rates) -> Push {
    let p = Parts::new(law, m);
    let (n, e) = (&m.normal, &p.direction);
    let across = |x: &Vec3| x - n * n.dot(x);
    let [slope, force] = [p.slope(law), p.normal_force(law)].map(|x| m.weight * x);
    let normal = slope * (e.force.dot(&along.velocity) + e.torque.dot(&along.spin));
    let slid = turning(&p.slip.tangential, p.slip.speed) * across(&along.velocity);
    let rolled = turning(&p.slip.roll, p.slip.roll_speed) * across(&along.spin);
    let twisted = n * (p.twist_slope(law) * n.dot(&along.spin));
    Push {
        force: e.force * normal - across(&slid) * (force * law.friction),
        torque: e.torque * normal
            - twisted * (force * law.torsional_friction)
            - across(&rolled) * (force * law.rolling_friction),
    }
}

/// Transpose of [`contact_force`] in all its arguments.
pub fn contact_force_vjp(law: &Law, m: &PointState, bar: &Push) -> ContactBar {
    let p = Parts::new(law, m);
    let force = p.normal_force(law);
    let slip = &p.slip;
    let along = p.direction.force.dot(&bar.force) + p.direction.torque.dot(&bar.torque);
    // F = weight N e: cotangents of N, of e, and through them of z, s and s_d.
    let force_bar = m.weight * along;
    let [e_bar, t_bar] = [bar.force, bar.torque].map(|bar| bar * (m.weight * force));
    let depth_bar = force_bar * law.stiffness * p.damping.0 * p.depth.1;
    let damping_bar = force_bar * law.stiffness * p.depth.0 * p.damping.1;
    let z_bar = -law.horizon * depth_bar - law.dissipation * damping_bar;
    let about = slip.twist / slip.twist_speed;
    let rolled = slip.roll / slip.roll_speed;
    let mut out = ContactBar {
        gap: -depth_bar,
        weight: along * force,
        normal: e_bar - t_bar * (law.torsional_friction * about),
        stiffness: force_bar * p.depth.0 * p.damping.0,
        dissipation: -p.approach * damping_bar,
        friction: -slip.tangential.dot(&e_bar) / slip.speed,
        torsional_friction: -about * m.normal.dot(&t_bar),
        rolling_friction: -rolled.dot(&t_bar),
        ..ContactBar::default()
    };
    let own = SlipBar {
        normal_speed: z_bar,
        tangential: -law.friction * (turning(&slip.tangential, slip.speed) * e_bar),
        twist: -law.torsional_friction * p.twist_slope(law) * m.normal.dot(&t_bar),
        roll: -law.rolling_friction * (turning(&slip.roll, slip.roll_speed) * t_bar),
        total: -z_bar,
    };
    out.rates = slip.vjp(law, (&m.normal, &m.rates), &own, &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::Mat6;

    fn law() -> Law {
        Law {
            stiffness: 2e4,
            dissipation: 0.7,
            friction: 0.65,
            torsional_friction: 0.03,
            rolling_friction: 0.02,
            stiction_speed: 1e-3,
            stiction_spin: 0.02,
            gap: 2e-3,
            width: 1e-4,
            horizon: 0.01,
        }
    }

    /// With a spin that goes with the velocity.
    fn point_state(gap: f64, velocity: Vec3) -> PointState {
        let spin = Vec3::new(3.0 * velocity.y, -velocity.z, 2.0 * velocity.x);
        PointState {
            gap,
            weight: 1.0,
            normal: Vec3::new(0.36, -0.48, 0.8),
            rates: Rates { velocity, spin },
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
            let Push { force: f, torque } = contact_force(&law, &m);
            let normal = f.dot(&m.normal);
            let tangential = f - m.normal * normal;
            assert!(normal >= 0.0 && tangential.norm() <= law.friction * normal * (1.0 + 1e-12));
            assert!(tangential.dot(&m.rates.velocity) <= 0.0);
            let about = torque.dot(&m.normal);
            let across = (torque - m.normal * about).norm();
            assert!(about.abs() <= law.torsional_friction * normal * (1.0 + 1e-12));
            assert!(across <= law.rolling_friction * normal * (1.0 + 1e-12));
            assert!(torque.dot(&m.rates.spin) <= 0.0);
            let known = Parts::new(&law, &m).normal_force(&law);
            assert!((normal - known).abs() <= 1e-12 * normal);
            let foreseen = law.gap - m.gap - law.horizon * Parts::new(&law, &m).approach;
            assert_eq!(
                normal > 0.0,
                foreseen > -law.width && m.rates.velocity.norm() < 1e3 && {
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
            let m = point_state(1.99e-3, velocity);
            let d = Mat6::from_fn(|i, j| {
                let unit = |k: usize| f64::from(k == j);
                let along = Rates {
                    velocity: Vec3::new(unit(0), unit(1), unit(2)),
                    spin: Vec3::new(unit(3), unit(4), unit(5)),
                };
                let push = contact_force_jvp(&law, &m, &along);
                if i < 3 {
                    push.force[i]
                } else {
                    push.torque[i - 3]
                }
            });
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
            let bar = Push {
                force: Vec3::new(1.0, 2.0, 3.0),
                torque: Vec3::new(3.0, 1.0, 2.0),
            };
            let bar = contact_force_vjp(&law, &m, &bar);
            let all = [
                bar.gap,
                bar.weight,
                bar.stiffness,
                bar.dissipation,
                bar.friction,
                bar.torsional_friction,
                bar.rolling_friction,
            ];
            assert!(all.iter().all(|x| x.is_finite()));
            assert!(
                bar.normal
                    .iter()
                    .chain(bar.rates.velocity.iter())
                    .chain(bar.rates.spin.iter())
                    .all(|x| x.is_finite())
            );
            let push = contact_force(&law, &m);
            assert!(push.force.iter().chain(&push.torque).all(|x| x.is_finite()));
        }
    }
}
