//! Everything that is decided about a simulation.

use crate::dynamics::Integrator;
use crate::scene::Preset;
use crate::water::WaterChoices;
use serde::{Deserialize, Serialize};

/// Everything that is decided about a simulation: what a scene, its preset and the settings make together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// How the water is computed.
    pub water: WaterChoices,
    /// How time is stepped.
    pub integrator: Integrator,
    /// The preset's integrator, where another stands in for it because it doesn't solve contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_place_of: Option<Integrator>,
    /// Time step, s.
    pub time_step: f64,
    /// Shapes that are parameters: names, or what names begin with.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape_parameters: Vec<String>,
}

impl Choices {
    /// The choices of a preset.
    pub fn preset(preset: Preset, time_step: f64) -> Self {
        Self {
            water: WaterChoices::preset(preset),
            integrator: match preset {
                Preset::Default => Integrator::default(),
                Preset::Paper => Integrator::VelocityEuler,
            },
            in_place_of: None,
            time_step,
            shape_parameters: Vec::new(),
        }
    }
}
