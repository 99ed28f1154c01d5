//! `hydrograd added-mass`: the water's inertia as the bodies feel it.

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use super::input;
use super::options::Water;
use super::output::{Output, write_warnings};
use crate::scene::{Scene, Shape};
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    source: Source,
    /// Density of the water in kg/m³ [default: the scene's own; 998 for a mesh or shape].
    #[arg(long, value_name = "RHO", allow_negative_numbers = true)]
    density: Option<f64>,
    #[command(flatten)]
    water: Water,
}

/// One of them must be given.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// A scene (.toml), at its start, or a mesh (.obj, .stl, .ply; metres).
    #[arg(value_name = "SCENE.toml|MESH")]
    file: Option<PathBuf>,
    /// A shape by formula, lengths in m: sphere:RADIUS, ellipsoid:A,B,C (semi-axes), box:A,B,C
    /// (edges), cylinder:RADIUS,LENGTH, capsule:RADIUS,LENGTH (without its ends); both along z.
    #[arg(long, value_name = "SHAPE", value_parser = crate::shape::parse_shape)]
    shape: Option<Shape>,
}

/// The added mass of all bodies. SI units.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
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
    pub fidelity: String,
    pub method: String,
    /// Density of the water, kg/m³.
    pub density: f64,
    pub warnings: Vec<String>,
}

pub(super) fn main(arguments: &Arguments, output: Output) -> Result<ExitCode> {
    let scene = input::scene_or_shape(
        arguments.source.file.as_deref(),
        arguments.source.shape.as_ref(),
        arguments.density,
        &arguments.water,
    )?;
    output.result(&added_mass(&scene, arguments)?);
    Ok(ExitCode::SUCCESS)
}

/// TO FILL IN: M_f of all bodies at the scene's start, with the settings of `arguments.water`.
fn added_mass(_scene: &Scene, _arguments: &Arguments) -> Result<Report> {
    Err(Error::Unsupported {
        what: "added-mass".into(),
        why: "the simulator isn't connected to the command line".into(),
        instead: "use the Rust interface".into(),
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "added mass in water of {} kg/m³, {} ({}): world axes, about each body's origin;",
            self.density, self.fidelity, self.method
        )?;
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
        write_warnings(f, &self.warnings)
    }
}
