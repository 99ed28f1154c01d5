//! How surfaces touch.

use super::Scene;
use serde::{Deserialize, Serialize};

/// Contact between bodies, and between bodies and walls. A scene that has it (`[contact]`, all keys of which may be left out)
/// keeps its bodies apart; bodies of one chain of joints that are neighbours don't touch each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// Stiffness of each point of contact, N/m. Default: ten times the heaviest moving body's mass over the square of the time
    /// step, which is near rigid at that step.
    pub stiffness: Option<f64>,
    /// Dissipation d of Hunt and Crossley, s/m: surfaces that part faster than 1/d don't press.
    pub dissipation: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Gap at which surfaces are taken to touch, m. Default: a quarter more than the coupling of the water resolves, so that the
    /// water between them stays resolved when a body lands; at least a hundredth of the smallest moving body's radius, because
    /// distances are smooth only outside a body.
    pub gap: Option<f64>,
    /// Half the width over which the force sets in, m; nothing acts at a larger distance than it beyond `gap`. Default: 0.4 % of
    /// the smallest moving body's radius.
    pub width: Option<f64>,
    /// Speed below which friction holds with creep, m/s.
    pub stiction_speed: f64,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            stiffness: None,
            dissipation: 0.5,
            friction: 0.5,
            gap: None,
            width: None,
            stiction_speed: 1e-3,
        }
    }
}

impl Scene {
    /// Whether anything in it is stopped by touching: surfaces, or joints at their limits.
    pub(crate) fn has_contact(&self) -> bool {
        self.contact.is_some() || self.limited().next().is_some()
    }

    /// Bodies whose joints have limits, with these.
    pub(crate) fn limited(&self) -> impl Iterator<Item = (usize, [f64; 2])> {
        let each = self.bodies.iter().enumerate();
        each.filter_map(|(b, body)| Some((b, body.limits?)))
    }
}
