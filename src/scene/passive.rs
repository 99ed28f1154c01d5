//! What a joint does by itself: spring, damping, friction, and the inertia of its rotor.

use super::{Body, Scene};
use serde::{Deserialize, Serialize};

/// Passive forces of a joint with one coordinate q (m or rad), and the inertia of what turns with it in its drive:
///
/// ```text
/// τ = −k (q − q₀) − c q̇ − τ_f q̇ / √(q̇² + v_f²)
/// ```
///
/// and `armature` q̇ is added to the joint's momentum, as a rotor of inertia J behind a gear of ratio n does with J n².
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Joint, Passive, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// let hinge = Joint::Revolute { axis: [0.0, 0.0, 1.0] };
/// let spring = Passive::default().stiffness(2.0).damping(0.1);
/// scene.add(Body::new(Shape::cuboid([0.2, 0.01, 0.1])).density(1100.0).joint(hinge).passive(spring));
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Passive {
    /// Stiffness k, N/m or N m/rad.
    pub stiffness: f64,
    /// Coordinate q₀ at which the spring doesn't push, m or rad.
    pub rest: f64,
    /// Viscous damping c, N s/m or N m s/rad.
    pub damping: f64,
    /// Coulomb friction τ_f, N or N m: what it comes to at speeds far above `friction_speed`.
    pub friction: f64,
    /// Speed v_f over which friction sets in, m/s or rad/s; below it the joint creeps. The shorter it is the stiffer: a step should be shorter than
    /// `friction_speed` times the inertia over `friction`, or the integrator an implicit one.
    pub friction_speed: f64,
    /// Inertia that the drive adds to the joint, kg or kg m².
    pub armature: f64,
}

impl Default for Passive {
    /// None of them.
    fn default() -> Self {
        Self {
            stiffness: 0.0,
            rest: 0.0,
            damping: 0.0,
            friction: 0.0,
            friction_speed: 0.02,
            armature: 0.0,
        }
    }
}

setters! { Passive {
    /// Stiffness, N/m or N m/rad.
    stiffness(stiffness: f64) => stiffness = stiffness;
    /// Coordinate at which the spring doesn't push, m or rad.
    rest(rest: f64) => rest = rest;
    /// Viscous damping, N s/m or N m s/rad.
    damping(damping: f64) => damping = damping;
    /// Coulomb friction, N or N m.
    friction(friction: f64) => friction = friction;
    /// Speed over which friction sets in, m/s or rad/s.
    friction_speed(speed: f64) => friction_speed = speed;
    /// Inertia that the drive adds to the joint, kg or kg m².
    armature(armature: f64) => armature = armature;
} }

impl Scene {
    /// A body whose joint resists its motion: by damping, friction or a servo.
    pub(crate) fn resisting(&self) -> Option<&Body> {
        let slows = |p: &Passive| p.damping > 0.0 || p.friction > 0.0;
        let resists = |b: &&Body| b.servo.is_some() || b.passive.as_ref().is_some_and(slows);
        self.bodies.iter().find(resists)
    }
}

setters! { Body {
    /// Spring, damping, friction and rotor of the joint.
    passive(passive: Passive) => passive = Some(passive);
} }
