//! Flags that several commands share.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use strum::{EnumMessage, VariantArray};

use crate::boundary::{Depth, RowScaling};
use crate::coupling::full::{FullSolver, Preconditioner};
use crate::dynamics::Integrator;
use crate::scene::{BadMeshes, Base, Followers, Preset, Robot, Scene, Wet};
use crate::simulate::{
    AdapterName, Arithmetic, Backend, Exchange, Fidelity, GpuSettings, Method, Settings, Simulator,
};
use crate::{Error, Result};

/// What the water is solved with; whatever isn't given follows the preset.
#[derive(Clone, Debug, Args)]
pub(super) struct Water {
    /// How much of the water's coupling is solved [default: auto; full with the preset paper].
    #[arg(long, value_parser = choice::<Fidelity>())]
    pub fidelity: Option<Fidelity>,
    /// How a body alone is solved [default: auto; mfs-face with the preset paper].
    #[arg(long, value_parser = choice::<Method>())]
    pub method: Option<Method>,
    /// Error of the added mass that the fidelities `reduced` and `auto` aim at, relative
    /// [default: 0.003 for reduced, which adds to that of the bodies themselves; 0.01 for auto]. The force across gaps gets more accurate with it.
    #[arg(long, value_name = "ERROR", value_parser = tolerance, allow_negative_numbers = true)]
    pub accuracy: Option<f64>,
    /// With `reduced` alone: points of each compressed body, up to 1000 [default: as many as the accuracy needs].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub rank: Option<usize>,
    /// With `reduced` alone: smallest gap in m that compressed bodies resolve [default: from each body's size].
    #[arg(long, value_name = "GAP", value_parser = length, allow_negative_numbers = true)]
    pub resolved_gap: Option<f64>,
    /// With `reduced`, `auto`, and `full` by panels: leave the water in gaps that compressed bodies or panels don't resolve to them, instead of adding it as films,
    /// down to contact.
    #[arg(long)]
    pub no_films: bool,
    /// With `reduced` and `auto`: how compressed bodies are coupled [default: auto].
    #[arg(long, value_parser = choice::<Exchange>())]
    pub exchange: Option<Exchange>,
    /// Folder that keeps compressed bodies for the next time.
    #[arg(long, value_name = "FOLDER")]
    pub cache: Option<PathBuf>,
    /// Depth of the sources under the surface in m; checked against edge length and thickness
    /// [default: from the mesh, source by source].
    #[arg(long, value_name = "DEPTH", value_parser = length, allow_negative_numbers = true)]
    pub depth: Option<f64>,
    /// Norm in which the rows of the boundary condition are fitted [default: scaled; unscaled with the preset paper].
    #[arg(long, value_parser = choice::<RowScaling>())]
    pub rows: Option<RowScaling>,
    /// Faces per body, for shapes by formula and the hulls of a robot's file; the nearest number that the shape allows is taken
    /// [default: the scene's own, else 1280, of hulls 320].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub faces: Option<usize>,
    /// Choices to start from [default: the scene's own, else default].
    #[arg(long, value_parser = choice::<Preset>())]
    pub preset: Option<Preset>,
    /// Relative residual at which the coupled solve stops [default: 1e-8; 1e-12 for gradcheck].
    #[arg(long, value_name = "TOL", value_parser = tolerance, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
    /// Solver of the coupled system [default: cgls].
    #[arg(long, value_parser = choice::<FullSolver>())]
    pub solver: Option<FullSolver>,
    /// Preconditioner of the coupled system [default: factors].
    #[arg(long, value_parser = choice::<Preconditioner>())]
    pub preconditioner: Option<Preconditioner>,
    /// How far a source reaches others with the preconditioner csd24, in its own scales [default: 3].
    #[arg(long, value_name = "RHO", value_parser = rho, allow_negative_numbers = true)]
    pub csd24_rho: Option<f64>,
    /// What computes the coupling.
    #[arg(long, value_parser = choice::<Backend>(), default_value = "cpu")]
    pub backend: Backend,
    #[command(flatten)]
    pub adapter: Adapter,
    /// Use the CPU where the GPU can't be opened, and say so.
    #[arg(long)]
    pub gpu_fallback: bool,
}

/// Which GPU, and how.
#[derive(Clone, Debug, Args)]
pub(super) struct Adapter {
    /// Part of the GPU's name, in any case [default: the fastest there is].
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<AdapterName>,
    /// Arithmetic of residuals and derivatives on the GPU.
    #[arg(long, value_parser = choice::<Arithmetic>(), default_value = "auto")]
    pub gpu_arithmetic: Arithmetic,
}

impl Adapter {
    pub fn settings(&self, fallback: bool) -> GpuSettings {
        GpuSettings {
            adapter: self.adapter.clone(),
            arithmetic: self.gpu_arithmetic,
            fallback,
        }
    }
}

/// How a robot's file, URDF or MJCF, is read; a scene file says this in its [[robot]].
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Of a robot's file (URDF or MJCF)")]
pub(super) struct RobotArguments {
    /// Folder that holds packages of meshes; may be given several times. Those of ROS_PACKAGE_PATH, the file's own and all above it come after.
    #[arg(long, value_name = "FOLDER")]
    package_path: Vec<PathBuf>,
    /// Whether the robot floats [default: free; fixed if its root is called world or has no mass].
    #[arg(long, value_parser = choice::<Base>())]
    base: Option<Base>,
    /// What the water sees of links [default: collision].
    #[arg(long, value_parser = choice::<Wet>())]
    wet: Option<Wet>,
    /// What is done about joints that follow others [default: follow].
    #[arg(long, value_parser = choice::<Followers>())]
    mimic: Option<Followers>,
    /// What is done about meshes that aren't closed or cross themselves [default: hull].
    #[arg(long, value_parser = choice::<BadMeshes>())]
    bad_meshes: Option<BadMeshes>,
    /// Let joints pass their limits.
    #[arg(long)]
    no_limits: bool,
}

impl RobotArguments {
    /// The choices, with so many faces.
    pub fn robot(&self, faces: Option<usize>) -> Robot {
        Robot {
            base: self.base,
            package_path: self.package_path.clone(),
            shape: self.wet.unwrap_or_default(),
            mimic: self.mimic.unwrap_or_default(),
            bad_meshes: self.bad_meshes.unwrap_or_default(),
            limits: self.no_limits.then_some(false),
            faces,
            ..Robot::default()
        }
    }

    /// The scene of a file: a scene file, or a robot, with so many faces, alone in still fresh water.
    pub fn scene(&self, path: &Path, faces: Option<usize>) -> Result<Scene> {
        if is_urdf(path) {
            return Scene::from_urdf(path, &self.robot(faces));
        }
        self.refuse(
            path.display().to_string(),
            "a scene file says them in its [[robot]] (`package_path`, `base`, `shape`, `mimic`, `bad_meshes`, `limits`)",
        )?;
        Scene::load(path)
    }

    /// Refuses choices for a place that isn't a robot's file.
    pub fn refuse(&self, place: String, expected: &str) -> Result<()> {
        match self.robot(None) == Robot::default() {
            true => Ok(()),
            false => Err(Error::input(place, "choices for a robot's file", expected)),
        }
    }
}

/// Whether a file is a robot, by its name.
pub(super) fn is_urdf(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    ["urdf", "mjcf", "xml"]
        .iter()
        .any(|known| extension.eq_ignore_ascii_case(known))
}

/// A scene, and how it is simulated.
#[derive(Debug, Args)]
pub(super) struct Simulation {
    /// The scene file, or a robot (.urdf, .mjcf, .xml), which is then alone in still fresh water.
    #[arg(value_name = "SCENE.toml|ROBOT.urdf")]
    scene: PathBuf,
    #[command(flatten)]
    pub water: Water,
    #[command(flatten)]
    robot: RobotArguments,
    /// Density of the water in kg/m³ [default: the scene's own, around a robot 998].
    #[arg(long, value_name = "RHO", allow_negative_numbers = true)]
    density: Option<f64>,
    /// Number of steps [default: the scene's own].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    steps: Option<usize>,
    /// Time step in s [default: the scene's own].
    #[arg(long, value_name = "DT", allow_negative_numbers = true)]
    time_step: Option<f64>,
    /// How a step is taken [default: rk4; with contact, limits of joints, lubrication, joints that damp or rub, and servos momentum-euler, or midpoint if joints hang on moving bodies and nothing touches; velocity-euler with the preset paper].
    #[arg(long, value_parser = choice::<Integrator>())]
    integrator: Option<Integrator>,
}

impl Simulation {
    /// The scene, with so many steps if that is asked for, checked.
    pub fn scene(&self) -> Result<Scene> {
        let mut scene = load(&self.scene, &self.robot, self.water.faces)?;
        scene.fluid.density = self.density.unwrap_or(scene.fluid.density);
        scene.steps = self.steps.unwrap_or(scene.steps);
        scene.validate()?;
        Ok(scene)
    }

    /// What was given.
    pub fn settings(&self) -> Settings {
        Settings {
            time_step: self.time_step,
            integrator: self.integrator,
            ..self.water.settings()
        }
    }
}

impl Water {
    /// What was given.
    pub fn settings(&self) -> Settings {
        Settings {
            preset: self.preset,
            fidelity: self.fidelity,
            method: self.method,
            depth: self.depth.map(Depth::Fixed),
            rows: self.rows,
            solver: self.solver,
            preconditioner: self.preconditioner,
            csd24_rho: self.csd24_rho,
            tolerance: self.tolerance,
            rank: self.rank,
            resolved_gap: self.resolved_gap,
            accuracy: self.accuracy,
            films: self.no_films.then_some(false),
            exchange: self.exchange,
            faces: self.faces,
            backend: Some(self.backend),
            gpu: Some(self.adapter.settings(self.gpu_fallback)),
            ..Settings::default()
        }
    }

    /// A simulator of the scene, with the cache that was asked for.
    pub fn simulator(&self, scene: &Scene, settings: Settings) -> Result<Simulator> {
        match &self.cache {
            Some(folder) => Simulator::cached(scene, settings, folder),
            None => Simulator::new(scene, settings),
        }
    }
}

/// The scene of a file; one without a name is called as the file.
pub(super) fn load(path: &Path, robot: &RobotArguments, faces: Option<usize>) -> Result<Scene> {
    let mut scene = robot.scene(path, faces)?;
    if scene.name.is_empty() {
        let stem = path.file_stem().unwrap_or_default();
        scene.name = stem.to_string_lossy().into_owned();
    }
    Ok(scene)
}

/// A whole number above zero.
pub(super) fn positive(text: &str) -> std::result::Result<usize, String> {
    let above = text.parse().ok().filter(|n| *n > 0);
    above.ok_or_else(|| "give a whole number above zero".into())
}

fn number(text: &str, below: f64, expected: &str) -> std::result::Result<f64, String> {
    let inside = |x: &f64| *x > 0.0 && *x < below;
    let found = text.parse().ok().filter(inside);
    found.ok_or_else(|| expected.into())
}

/// A length above zero.
pub(super) fn length(text: &str) -> std::result::Result<f64, String> {
    number(text, f64::INFINITY, "give a length above zero, in m")
}

/// A time above zero.
pub(super) fn seconds(text: &str) -> std::result::Result<f64, String> {
    number(text, f64::INFINITY, "give a time above zero, in s")
}

/// A number of times a second above zero.
pub(super) fn rate(text: &str) -> std::result::Result<f64, String> {
    number(text, f64::INFINITY, "give a number above zero, per second")
}

pub(super) fn tolerance(text: &str) -> std::result::Result<f64, String> {
    number(text, 1.0, "give a number between 0 and 1, e.g. 1e-8")
}

fn rho(text: &str) -> std::result::Result<f64, String> {
    let inside = text.parse().ok().filter(|x| (1.0..=20.0).contains(x));
    inside.ok_or_else(|| "give a number between 1 and 20, e.g. 3".into())
}

/// Parser of a choice from a list: names and help come from the list itself.
pub(super) fn choice<T>() -> impl TypedValueParser<Value = T>
where
    T: VariantArray + EnumMessage + FromStr<Err: std::error::Error + Send + Sync>,
    T: Into<&'static str> + Copy + Send + Sync + 'static,
{
    let possible = T::VARIANTS.iter().map(|of| {
        let help = of.get_documentation().unwrap_or_default();
        let words: Vec<&str> = help.split_whitespace().collect();
        PossibleValue::new((*of).into()).help(words.join(" ").trim_end_matches('.').to_string())
    });
    PossibleValuesParser::new(possible).try_map(|name| name.parse())
}
