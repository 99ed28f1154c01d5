//! Flags that several commands share.

use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::PathBuf;

use super::backend::Compute;
use crate::Result;
use crate::boundary::{self, OneBody};
use crate::coupling::{full, panel};
use crate::dynamics;
use crate::scene::{Preset, Scene};
use crate::simulate::{self, Settings, Simulator};

/// How much of the water's coupling is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Fidelity {
    /// Each body as if it were alone in the water.
    Isolated,
    /// All bodies coupled, each compressed to a few sources.
    Reduced,
    /// `reduced`, with what each body and pair needs chosen for the scene; `full` where that can't
    /// resolve it.
    Auto,
    /// All bodies coupled, at the resolution of their meshes.
    #[default]
    Full,
}

/// How a body alone is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Method {
    /// The most accurate that costs nothing at run time: `exact` where there is a formula, else
    /// `panel`; `mfs-vertex` with the fidelity `full`.
    Auto,
    /// Closed forms, for spheres and ellipsoids by formula.
    Exact,
    /// Direct boundary elements: no sources inside. With the fidelity `full` values only, no motion.
    Panel,
    /// A source under each vertex, exact flux through each face, least squares.
    MfsVertex,
    /// A source under each face, velocity at face centres (the paper's Eq. 17–18).
    MfsFace,
}

/// Norm in which the rows of the boundary condition are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Rows {
    /// The L² norm of the normal velocity: small and large bodies count alike.
    Scaled,
    /// Plain least squares; ruins small bodies beside large ones.
    Unscaled,
}

/// How a step is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Integrator {
    /// Symplectic Euler in momentum, implicit in p at fixed q: first order.
    MomentumEuler,
    /// Implicit midpoint in momentum: second order, energy bounded.
    Midpoint,
    /// Explicit midpoint rule in momentum: second order, two evaluations.
    Rk2,
    /// Runge–Kutta in momentum: fourth order, four evaluations.
    Rk4,
    /// Semi-implicit Euler in velocity (the paper's Eq. 3–4): first order.
    VelocityEuler,
}

/// Solver of the coupled system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Solver {
    /// Conjugate gradients on the least-squares problem.
    Cgls,
    /// A dense factorisation, as a reference: QR, or LU with the method panel.
    Qr,
    /// GMRES; for the square systems of `mfs-face` and `panel` only.
    Gmres,
}

/// Preconditioner of the coupled system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Preconditioner {
    /// Each body's own factorisation, made once.
    Factors,
    /// The diagonal.
    Jacobi,
    /// None.
    None,
}

/// A family of choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum PresetName {
    /// hydrograd's own.
    Default,
    /// The paper's: face sources, rows not scaled, potential read at face centres, semi-implicit
    /// Euler in velocity.
    Paper,
}

/// What the water is solved with; whatever isn't given follows the preset.
#[derive(Clone, Debug, Args)]
pub(super) struct Water {
    /// How much of the water's coupling is solved.
    #[arg(long, value_enum, default_value_t = Fidelity::Full)]
    pub fidelity: Fidelity,
    /// How a body alone is solved [default: auto; mfs-face with the preset paper].
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// Error of the added mass that the fidelities `reduced` and `auto` aim at, relative
    /// [default: 0.003 for reduced, which adds to that of the bodies themselves; 0.01 for auto].
    #[arg(long, value_name = "ERROR", value_parser = tolerance, allow_negative_numbers = true)]
    pub accuracy: Option<f64>,
    /// With `reduced` alone: points of each compressed body, up to 1000 [default: as many as the accuracy needs].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub rank: Option<usize>,
    /// With `reduced` alone: smallest gap in m that compressed bodies resolve [default: from each body's size].
    #[arg(long, value_name = "GAP", value_parser = length, allow_negative_numbers = true)]
    pub resolved_gap: Option<f64>,
    /// Folder that keeps compressed bodies for the next time.
    #[arg(long, value_name = "FOLDER")]
    pub cache: Option<PathBuf>,
    /// Depth of the sources under the surface in m; checked against edge length and thickness
    /// [default: from the mesh, source by source].
    #[arg(long, value_name = "DEPTH", value_parser = length, allow_negative_numbers = true)]
    pub depth: Option<f64>,
    /// Norm in which the rows are fitted [default: scaled; unscaled with the preset paper].
    #[arg(long, value_enum)]
    pub rows: Option<Rows>,
    /// Faces per body, for shapes by formula; the nearest number that the shape allows is taken
    /// [default: the scene's own, else 1280].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub faces: Option<usize>,
    /// Choices to start from [default: the scene's own, else default].
    #[arg(long, value_enum)]
    pub preset: Option<PresetName>,
    /// Relative residual at which the coupled solve stops [default: 1e-8; 1e-12 for gradcheck].
    #[arg(long, value_name = "TOL", value_parser = tolerance, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
    /// Solver of the coupled system [default: cgls].
    #[arg(long, value_enum)]
    pub solver: Option<Solver>,
    /// Preconditioner of the coupled system [default: factors].
    #[arg(long, value_enum)]
    pub preconditioner: Option<Preconditioner>,
    #[command(flatten)]
    pub compute: Compute,
}

/// How time is stepped.
#[derive(Clone, Debug, Args)]
pub(super) struct Time {
    /// Number of steps [default: the scene's own].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub steps: Option<usize>,
    /// Time step in s [default: the scene's own].
    #[arg(long, value_name = "DT", allow_negative_numbers = true)]
    pub time_step: Option<f64>,
    /// How a step is taken [default: rk2; velocity-euler with the preset paper].
    #[arg(long, value_enum)]
    pub integrator: Option<Integrator>,
}

impl From<Fidelity> for simulate::Fidelity {
    fn from(fidelity: Fidelity) -> Self {
        match fidelity {
            Fidelity::Isolated => Self::Isolated,
            Fidelity::Reduced => Self::Reduced,
            Fidelity::Auto => Self::Auto,
            Fidelity::Full => Self::Full,
        }
    }
}

impl From<Integrator> for dynamics::Integrator {
    fn from(integrator: Integrator) -> Self {
        match integrator {
            Integrator::MomentumEuler => Self::MomentumEuler,
            Integrator::Midpoint => Self::Midpoint,
            Integrator::Rk2 => Self::Rk2,
            Integrator::Rk4 => Self::Rk4,
            Integrator::VelocityEuler => Self::VelocityEuler,
        }
    }
}

impl Method {
    /// Puts the method into the settings.
    pub fn choose(self, settings: Settings) -> Settings {
        match self {
            Method::Auto => settings.one_body(OneBody::Auto),
            Method::Exact => settings.one_body(OneBody::Exact),
            Method::Panel => settings.one_body(OneBody::Panel),
            Method::MfsVertex => settings.method(boundary::Method::MfsVertex),
            Method::MfsFace => settings.method(boundary::Method::MfsFace),
        }
    }
}

impl Water {
    /// Puts preset and number of faces into the scene.
    pub fn apply(&self, scene: &mut Scene) {
        match self.preset {
            Some(PresetName::Default) => scene.preset = Preset::Default,
            Some(PresetName::Paper) => scene.preset = Preset::Paper,
            None => {}
        }
        if let Some(faces) = self.faces {
            scene.set_faces(faces);
        }
    }

    /// The settings of a scene that has been through [`Water::apply`]: its preset, then what was
    /// given.
    pub fn settings(&self, scene: &Scene) -> Settings {
        let settings = Settings::for_scene(scene).fidelity(self.fidelity.into());
        let mut settings = self.compute.choose(settings);
        if let Some(method) = self.method {
            settings = method.choose(settings);
        }
        if let Some(accuracy) = self.accuracy {
            settings = settings.accuracy(accuracy);
        }
        settings.compress.rank = self.rank;
        settings.compress.resolved_gap = self.resolved_gap;
        if let Some(depth) = self.depth {
            settings.boundary.depth = boundary::Depth::Fixed(depth);
        }
        if let Some(rows) = self.rows {
            settings.boundary.rows = match rows {
                Rows::Scaled => boundary::RowScaling::Scaled,
                Rows::Unscaled => boundary::RowScaling::Unscaled,
            };
        }
        if let Some(tolerance) = self.tolerance {
            settings.solve.tolerance = tolerance;
        }
        if let Some(solver) = self.solver {
            settings.panel = match solver {
                Solver::Qr => panel::Solver::Lu,
                _ => panel::Solver::Gmres,
            };
            settings.solve.solver = match solver {
                Solver::Cgls => full::Solver::Cgls,
                Solver::Qr => full::Solver::Qr,
                Solver::Gmres => full::Solver::Gmres,
            };
        }
        if let Some(preconditioner) = self.preconditioner {
            settings.solve.preconditioner = match preconditioner {
                Preconditioner::Factors => full::Preconditioner::Factors,
                Preconditioner::Jacobi => full::Preconditioner::Jacobi,
                Preconditioner::None => full::Preconditioner::None,
            };
        }
        settings
    }
}

impl Water {
    /// A simulator of the scene, with the cache that was asked for.
    pub fn simulator(&self, scene: &Scene, settings: Settings) -> Result<Simulator> {
        match &self.cache {
            Some(folder) => Simulator::cached(scene, settings, folder),
            None => Simulator::new(scene, settings),
        }
    }
}

impl Time {
    /// Puts time step and number of steps into the scene.
    pub fn apply(&self, scene: &mut Scene) {
        scene.steps = self.steps.unwrap_or(scene.steps);
        scene.time_step = self.time_step.unwrap_or(scene.time_step);
    }

    /// Puts the integrator into the settings, if one was given.
    pub fn choose(&self, settings: Settings) -> Settings {
        match self.integrator {
            None => settings,
            Some(integrator) => settings.integrator(integrator.into()),
        }
    }
}

/// A whole number above zero.
pub(super) fn positive(text: &str) -> std::result::Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("give a whole number above zero".into()),
        Ok(n) => Ok(n),
    }
}

fn length(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(x) if x > 0.0 && f64::is_finite(x) => Ok(x),
        _ => Err("give a length above zero, in m".into()),
    }
}

pub(super) fn tolerance(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(x) if x > 0.0 && x < 1.0 => Ok(x),
        _ => Err("give a number between 0 and 1, e.g. 1e-8".into()),
    }
}

/// The name of a choice as it stands on the command line.
pub(super) fn name(choice: impl Serialize) -> String {
    match serde_json::to_value(choice) {
        Ok(serde_json::Value::String(name)) => name,
        _ => String::new(),
    }
}
