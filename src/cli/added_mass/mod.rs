//! `hydrograd added-mass`: the water's inertia as the bodies feel it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde::Serialize;

mod format;

use super::exit::Exit;
use super::options::{RobotArguments, Water, is_urdf};
use super::output::{ChoicesReport, Output, note, print_text, write_warnings};
use crate::scene::{Body, Fluid, Scene, Shape};
use crate::simulate::ErrorEstimate;
use crate::{Error, Result};
use format::{Format, Own};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    source: Source,
    /// Density of the water in kg/m³ [default: the scene's own; 998, fresh water at 20 °C, for a
    /// mesh or shape].
    #[arg(long, value_name = "RHO", allow_negative_numbers = true)]
    density: Option<f64>,
    /// Estimate the error of the result, from the same bodies on other meshes and from what is left at
    /// check points; takes a few times as long.
    #[arg(long, conflicts_with = "format")]
    estimate: bool,
    /// Write each body's own 6 × 6, in its own axes about its origin, as other simulators read it; what bodies do to each other is left out.
    #[arg(long, value_enum, value_name = "FORMAT", conflicts_with = "json")]
    format: Option<Format>,
    #[command(flatten)]
    water: Water,
    #[command(flatten)]
    robot: RobotArguments,
}

/// One of them must be given.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// A scene (.toml) or robot (.urdf, .mjcf, .xml), at its start, or a mesh (.obj, .stl, .ply, .dae; metres).
    #[arg(value_name = "SCENE.toml|ROBOT.urdf|MESH")]
    file: Option<PathBuf>,
    /// A shape by formula, lengths in m: sphere:RADIUS, ellipsoid:A,B,C (semi-axes), box:A,B,C
    /// (edges), cylinder:RADIUS,LENGTH, capsule:RADIUS,LENGTH (without its ends), both along z,
    /// prism:LENGTH,Y1,Z1,Y2,Z2,Y3,Z3,… (length along x, corners of the convex profile).
    #[arg(long, value_name = "SHAPE", value_parser = crate::shape::parse_shape)]
    shape: Option<Shape>,
}

impl Source {
    /// What is asked about, as a scene; `density` replaces the water's, and `faces` are those of a robot.
    fn scene(
        &self,
        density: Option<f64>,
        robot: &RobotArguments,
        faces: Option<usize>,
    ) -> Result<Scene> {
        let alone = |shape: Shape, name: &str, place: String| {
            let only = "only robots (.urdf, .mjcf, .xml) have them: leave them out";
            robot.refuse(place, only)?;
            let mut scene = Scene::new(Fluid::fresh_water());
            let density = scene.fluid.density;
            scene.name = name.into();
            scene.add(Body::new(shape).named(name).density(density));
            Ok::<_, Error>(scene)
        };
        let mut scene = if let Some(shape) = &self.shape {
            alone(shape.clone(), shape.kind(), "--shape".into())?
        } else {
            // The command line asks for one of the two.
            let path = self.file.as_deref().unwrap_or(Path::new(""));
            let extension = path.extension().unwrap_or_default().to_string_lossy();
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            match extension.to_ascii_lowercase().as_str() {
                "obj" | "stl" | "ply" | "dae" => {
                    alone(Shape::mesh(path), &stem, path.display().to_string())?
                }
                scene if scene == "toml" || is_urdf(path) => robot.scene(path, faces)?,
                _ => {
                    return Err(Error::input(
                        path.display().to_string(),
                        format!("a name that ends in {extension:?}"),
                        "give a scene (.toml), a robot (.urdf, .mjcf, .xml), a mesh (.obj, .stl, .ply, .dae), or a shape by \
                     --shape, e.g. --shape sphere:0.5",
                    ));
                }
            }
        };
        if let Some(density) = density {
            scene.fluid.density = density;
        }
        scene.validate()?;
        Ok(scene)
    }
}

/// The added mass of all bodies. SI units.
#[derive(Clone, Debug, Serialize)]
pub(super) struct AddedMassReport {
    /// Names, in the order of the matrix.
    pub bodies: Vec<String>,
    /// 6B × 6B, rows; per body linear x y z, then angular x y z; world axes, about each body's
    /// origin.
    pub added_mass: Vec<Vec<f64>>,
    /// Asymmetry before the matrix was symmetrised: max |M_ij − M_ji| / √(M_ii M_jj).
    pub asymmetry: f64,
    /// Volume of all bodies, m³.
    pub volume: f64,
    /// Faces of all bodies.
    pub faces: usize,
    /// Sources of all bodies.
    pub unknowns: usize,
    /// Iterations of the coupled solve.
    pub iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
    #[serde(flatten)]
    pub choices: ChoicesReport,
    /// Density of the water, kg/m³.
    pub density: f64,
    pub warnings: Vec<String>,
    /// With `--estimate`: the error of `added_mass`, max |ΔM_ij| / √(M_ii M_jj), and its parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_estimate: Option<ErrorEstimate>,
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    if output.json && arguments.format.is_some() {
        // The arguments' own check doesn't see what stands before the command.
        output.error(&Error::input(
            "--format",
            "--json besides",
            "give one of them: its text isn't the report",
        ));
        return Ok(Exit::Usage);
    }
    let scene =
        arguments
            .source
            .scene(arguments.density, &arguments.robot, arguments.water.faces)?;
    if let Some(format) = arguments.format {
        return written(&scene, arguments, format);
    }
    output.result(&added_mass(&scene, arguments)?);
    Ok(Exit::Done)
}

/// Each body's own part in a format of others.
fn written(scene: &Scene, arguments: &Arguments, format: Format) -> Result<Exit> {
    let settings = arguments.water.settings();
    let simulator = arguments.water.simulator(scene, settings)?;
    let found = simulator.added_mass()?;
    for warning in simulator.warnings() {
        note(format_args!("warning: {warning}"));
    }
    let names = found.bodies.iter().enumerate();
    let own = names.map(|(k, name)| Own {
        name,
        matrix: found.own(k),
    });
    let bodies: Vec<Own> = own.collect();
    print_text(&format.write(&bodies, simulator.parameters().density()));
    Ok(Exit::Done)
}

/// M_f of all bodies at the scene's start.
fn added_mass(scene: &Scene, arguments: &Arguments) -> Result<AddedMassReport> {
    let start = Instant::now();
    let settings = arguments.water.settings();
    let simulator = arguments.water.simulator(scene, settings)?;
    let found = simulator.added_mass()?;
    let seconds = start.elapsed().as_secs_f64();
    let error_estimate = arguments.estimate.then(|| simulator.error_estimate());
    let error_estimate = error_estimate.transpose()?;
    let bodies = &simulator.system().bodies;
    let in_water = bodies.iter().filter(|b| b.submerged.is_some());
    let mut warnings = simulator.warnings().to_vec();
    warnings.extend(simulator.start_gap_warning());
    let left_out: Vec<&str> = bodies
        .iter()
        .filter(|b| b.submerged.is_none() && b.volume > 0.0)
        .map(|b| b.name.as_str())
        .collect();
    if !left_out.is_empty() {
        warnings.push(format!(
            "with the fidelity isolated bodies that nothing moves are left out: {}",
            left_out.join(", ")
        ));
    }
    let rows = found.matrix.row_iter();
    Ok(AddedMassReport {
        added_mass: rows.map(|r| r.iter().copied().collect()).collect(),
        bodies: found.bodies,
        asymmetry: found.report.asymmetry,
        volume: in_water.map(|b| b.volume).sum(),
        faces: simulator.faces(),
        unknowns: simulator.unknowns(),
        iterations: found.report.iterations,
        seconds,
        choices: ChoicesReport::new(&simulator),
        density: simulator.parameters().density(),
        warnings,
        error_estimate,
    })
}

impl fmt::Display for AddedMassReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let choices = &self.choices;
        writeln!(
            f,
            "added mass in water of {} kg/m³, {} ({}): world axes, about each body's origin;",
            self.density, choices.fidelity_used, choices.method
        )?;
        for reason in &choices.chosen {
            writeln!(f, "chosen: {reason}")?;
        }
        writeln!(
            f,
            "rows and columns u_x u_y u_z (kg), w_x w_y w_z (kg m²) of {}",
            self.bodies.join(", ")
        )?;
        for row in &self.added_mass {
            for x in row {
                write!(f, " {x:>12.5e}")?;
            }
            writeln!(f)?;
        }
        write!(
            f,
            "asymmetry {:.1e}; volume {:.6e} m³; {} faces, {} unknowns, {} iterations, {:.3} s",
            self.asymmetry, self.volume, self.faces, self.unknowns, self.iterations, self.seconds
        )?;
        write!(f, "\nbackend {}", choices.backend)?;
        if let Some(estimate) = &self.error_estimate {
            write_estimate(f, estimate)?;
        }
        write_warnings(f, &self.warnings)
    }
}

fn write_estimate(f: &mut fmt::Formatter<'_>, estimate: &ErrorEstimate) -> fmt::Result {
    match estimate.total {
        Some(total) => write!(f, "\nestimated error {total:.1e} of √(M_ii M_jj)")?,
        None => write!(f, "\nno estimate of the error, only parts of it")?,
    }
    let parts = [
        ("other meshes", estimate.extrapolation),
        ("check points", estimate.residual),
        ("missing coupling", estimate.coupling),
        ("asymmetry", Some(estimate.asymmetry)),
    ];
    for (name, part) in parts {
        if let Some(part) = part.filter(|p| *p > 0.0) {
            write!(f, "; {name} {part:.1e}")?;
        }
    }
    let mut missing = estimate.missing.iter();
    missing.try_for_each(|m| write!(f, "\nnot estimated: {m}"))
}
