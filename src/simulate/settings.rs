//! What a user may choose about a simulation.

use crate::boundary;
use crate::coupling::full::{SolveSettings, Solver};
use crate::dynamics::Integrator;
use crate::scene::{Preset, Scene};
use serde::{Deserialize, Serialize};

/// How much of the coupling is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fidelity {
    /// Each body's own constant added mass (Eq. 12); no walls.
    Isolated,
    /// The coupled system of all bodies (Eq. 18–20), walls as images.
    #[default]
    Full,
}

/// Settings of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How much of the coupling is modelled.
    pub fidelity: Fidelity,
    /// One-body method.
    pub boundary: boundary::Settings,
    /// Coupled solve.
    pub solve: SolveSettings,
    /// Time integrator.
    pub integrator: Integrator,
    /// Time step, s; default: the scene's.
    pub time_step: Option<f64>,
    /// Faces per body of shapes by formula; default: the scene's.
    pub faces: Option<usize>,
}

impl Settings {
    /// The settings of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Default => Self::default(),
            Preset::Paper => Self {
                boundary: boundary::Settings {
                    rows: boundary::RowScaling::Unscaled,
                    ..boundary::Settings::plain(boundary::Method::MfsFace, boundary::Depth::Auto)
                },
                solve: SolveSettings {
                    solver: Solver::Cgls,
                    ..SolveSettings::default()
                },
                integrator: Integrator::VelocityEuler,
                ..Self::default()
            },
        }
    }

    /// What a scene asks for.
    pub fn for_scene(scene: &Scene) -> Self {
        Self::preset(scene.preset)
    }

    /// With another time step, s.
    pub fn time_step(mut self, dt: f64) -> Self {
        self.time_step = Some(dt);
        self
    }

    /// With another fidelity.
    pub fn fidelity(mut self, fidelity: Fidelity) -> Self {
        self.fidelity = fidelity;
        self
    }

    /// With another integrator.
    pub fn integrator(mut self, integrator: Integrator) -> Self {
        self.integrator = integrator;
        self
    }

    /// With another number of faces per body, for shapes by formula.
    pub fn faces(mut self, faces: usize) -> Self {
        self.faces = Some(faces);
        self
    }

    /// With another one-body method.
    pub fn method(mut self, method: boundary::Method) -> Self {
        self.boundary.method = method;
        self
    }

    /// With another tolerance of the coupled solve.
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.solve.tolerance = tolerance;
        self
    }
}
