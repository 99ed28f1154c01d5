//! How surfaces touch.

use super::{Placement, Scene, Shape, is_default};
use serde::{Deserialize, Serialize};

/// Contact between bodies, and between bodies and walls. A scene that has it (`[contact]`, all keys of which may be left out)
/// keeps its bodies apart; bodies of one chain of joints that are neighbours don't touch each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// Stiffness of each point of contact, N/m. Default: ten times the heaviest moving body's mass, or that of the water it displaces where that is more, over the square of the time
    /// step, which is near rigid at that step.
    pub stiffness: Option<f64>,
    /// Dissipation d of Hunt and Crossley, s/m: surfaces that part faster than 1/d don't press.
    pub dissipation: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Torsional friction, m: the torque against spinning about the normal, per normal force. Of a patch of contact with radius a that
    /// presses evenly it is ⅔ `friction` a. Default: 0.
    pub torsional_friction: f64,
    /// Rolling friction, m: the torque against rolling, about axes across the normal, per normal force: a ball of radius r that rolls on
    /// a slope less steep than this over r comes to rest. Default: 0.
    pub rolling_friction: f64,
    /// Gap at which surfaces are taken to touch, m. Default: a hundredth of the smallest moving body's radius, because distances are smooth only
    /// outside a body; where the water is made by sources (compressed bodies without films, fundamental solutions) at least a quarter more than
    /// they resolve, so that it has a solution when a body lands.
    pub gap: Option<f64>,
    /// Half the width over which the force sets in, m; nothing acts at a larger distance than it beyond `gap`. Default: 0.4 % of
    /// the smallest moving body's radius.
    pub width: Option<f64>,
    /// Speed below which friction holds with creep, m/s; over the smaller body's radius, rad/s, that of torsional and rolling friction.
    pub stiction_speed: f64,
}

/// A convex piece of a body, for contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CollisionPiece {
    /// What it is: by a formula, or a convex mesh.
    pub shape: Shape,
    /// Its pose in the body's frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: Placement,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            stiffness: None,
            dissipation: 0.5,
            friction: 0.5,
            torsional_friction: 0.0,
            rolling_friction: 0.0,
            gap: None,
            width: None,
            stiction_speed: 1e-3,
        }
    }
}

impl Scene {
    /// Whether anything in it is solved in the velocity that a step moves by: what is stopped by touching, surfaces or joints at their limits, and what
    /// viscous water does in gaps.
    pub(crate) fn has_contact(&self) -> bool {
        self.contact.is_some()
            || self.limited().next().is_some()
            || self.lubrications().next().is_some()
    }

    /// Bodies whose joints have limits, with these.
    pub(crate) fn limited(&self) -> impl Iterator<Item = (usize, [f64; 2])> {
        let each = self.bodies.iter().enumerate();
        each.filter_map(|(b, body)| Some((b, body.limits?)))
    }
}
