//! What a user may choose about a simulation.

use super::backend::{Backend, GpuSettings};
use crate::boundary::{self, OneBody};
use crate::coupling::full::{SolveSettings, Solver};
use crate::coupling::panel;
use crate::coupling::reduced::compress;
use crate::dynamics::Integrator;
use crate::scene::{Preset, Scene};
use serde::{Deserialize, Serialize};

/// How much of the coupling is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fidelity {
    /// Each body's own constant added mass (Eq. 12); no walls.
    Isolated,
    /// Multiple scattering between a few sources a body, walls as images: see
    /// [`crate::coupling::reduced`].
    Reduced,
    /// `Reduced`, with what each body resolves and which pairs are coupled at all chosen for the
    /// scene from [`Settings::accuracy`]; `Full` where its gaps are too small for that.
    Auto,
    /// The coupled system of all bodies (Eq. 18–20), walls as images.
    #[default]
    Full,
}

/// A relative error that is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Accuracy(pub f64);

impl Default for Accuracy {
    fn default() -> Self {
        Self(0.01)
    }
}

/// Settings of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How much of the coupling is modelled.
    pub fidelity: Fidelity,
    /// Method by which each body alone is solved.
    pub one_body: OneBody,
    /// Fundamental solutions, where they are used.
    pub boundary: boundary::Settings,
    /// Coupled solve with the fidelity `Full`.
    pub solve: SolveSettings,
    /// Solver of the coupled panel method (`Full` with [`OneBody::Panel`]).
    pub panel: panel::Solver,
    /// Compression with the fidelity `Reduced`.
    pub compress: compress::Settings,
    /// Error of M_f, relative to √(M_ii M_jj), that the fidelity `Auto` aims at.
    pub accuracy: Accuracy,
    /// Time integrator.
    pub integrator: Integrator,
    /// Time step, s; default: the scene's.
    pub time_step: Option<f64>,
    /// Faces per body of shapes by formula; default: the scene's.
    pub faces: Option<usize>,
    /// What computes the coupling.
    pub backend: Backend,
    /// Choices of [`Backend::Gpu`].
    pub gpu: GpuSettings,
}

impl Settings {
    /// The settings of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Default => Self::default(),
            Preset::Paper => Self {
                one_body: OneBody::Mfs,
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
    ///
    /// Contact is solved in the velocity that a step moves by: a scene with contact gets
    /// [`Integrator::MomentumEuler`] where the preset's integrator can't do that.
    pub fn for_scene(scene: &Scene) -> Self {
        let settings = Self::preset(scene.preset);
        if scene.has_contact() && !settings.integrator.solves_contact() {
            return settings.integrator(Integrator::MomentumEuler);
        }
        settings
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

    /// With fundamental solutions as the one-body method.
    pub fn method(mut self, method: boundary::Method) -> Self {
        self.one_body = OneBody::Mfs;
        self.boundary.method = method;
        self
    }

    /// With another one-body method.
    pub fn one_body(mut self, method: OneBody) -> Self {
        self.one_body = method;
        self
    }

    /// With another number of points a body (`Reduced`).
    pub fn rank(mut self, rank: usize) -> Self {
        self.compress.rank = Some(rank);
        self
    }

    /// With another smallest gap that is resolved (`Reduced`), m.
    pub fn resolved_gap(mut self, gap: f64) -> Self {
        self.compress.resolved_gap = Some(gap);
        self
    }

    /// With another error of M_f to aim at (`Reduced` and `Auto`).
    pub fn accuracy(mut self, error: f64) -> Self {
        self.compress.tolerance = error;
        self.accuracy = Accuracy(error);
        self
    }

    /// With another backend.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Whether ellipsoids are solved by formula.
    pub(super) fn by_formula(&self) -> bool {
        self.fidelity != Fidelity::Full && matches!(self.one_body, OneBody::Auto | OneBody::Exact)
    }

    /// Name of the one-body method, as on the command line.
    pub fn method_name(&self) -> &'static str {
        match (self.one_body, self.boundary.method) {
            (OneBody::Auto, _) if self.fidelity != Fidelity::Full => "auto",
            (OneBody::Exact, _) => "exact",
            (OneBody::Panel, _) => "panel",
            (_, boundary::Method::MfsVertex) => "mfs-vertex",
            (_, boundary::Method::MfsFace) => "mfs-face",
        }
    }

    /// With another residual at which the iterative solves of the fidelity `Full` stop.
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.solve.tolerance = tolerance;
        self
    }
}
