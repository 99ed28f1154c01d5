//! Joints that a drive holds at a target.

use super::Body;
use serde::{Deserialize, Serialize};

/// Makes the control of an actuated joint with one coordinate its target u (m or rad) instead of its force: a proportional–derivative drive,
///
/// ```text
/// τ = k (u − q − Δt q̇) − c q̇
/// ```
///
/// q + Δt q̇ being where the joint is at the end of the step. With an integrator that takes the velocity from there (`momentum-euler`, `energy-euler`) it is implicit, and stable however stiff; with `midpoint`,
/// whose q is that of the middle, and q̇ one between the middle's and the end's, the later the stiffer, it is so too, and looks beyond the end: of first order, as if c were k Δt larger.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Servo {
    /// Stiffness k, N/m or N m/rad.
    pub stiffness: f64,
    /// Damping c, N s/m or N m s/rad.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub damping: f64,
}

impl Servo {
    /// Of these gains: N/m or N m/rad, N s/m or N m s/rad.
    pub fn new(stiffness: f64, damping: f64) -> Self {
        Self { stiffness, damping }
    }
}

setters! { Body {
    /// Makes the control of the actuated joint its target.
    servo(servo: Servo) => servo = Some(servo);
} }
