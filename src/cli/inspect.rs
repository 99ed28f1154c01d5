//! `hydrograd inspect`: what a robot in a URDF or MJCF file, or those of a scene, come to.

use std::fmt;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::exit::Exit;
use super::options::{RobotArguments, positive};
use super::output::Output;
use crate::scene::{Fluid, RobotReport};
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The robot (.urdf, .mjcf, .xml), or a scene (.toml) with robots.
    #[arg(value_name = "SCENE.toml|ROBOT.urdf")]
    file: PathBuf,
    #[command(flatten)]
    robot: RobotArguments,
    /// Faces of hulls, of meshes that have more than twice as many, and of shapes by formula [default: 320, of shapes their own].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    faces: Option<usize>,
    /// Density of the water in kg/m³ [default: 998; a scene's own].
    #[arg(long, value_name = "RHO", allow_negative_numbers = true)]
    density: Option<f64>,
}

/// Those of a scene.
#[derive(Serialize)]
struct Robots<'s> {
    robots: &'s [RobotReport],
}

impl fmt::Display for Robots<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, report) in self.robots.iter().enumerate() {
            let between = if i > 0 { "\n\n" } else { "" };
            write!(f, "{between}{report}")?;
        }
        Ok(())
    }
}

/// Prints what robots come to.
pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    let file = &arguments.file;
    if file
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
    {
        if let Some(density) = arguments.density {
            let right = "a scene file says it in its `fluid`: leave it out";
            return Err(Error::input("--density", density, right));
        }
        if let Some(faces) = arguments.faces {
            let right = "a scene file says it in its [[robot]]: leave it out";
            return Err(Error::input("--faces", faces, right));
        }
        let scene = arguments.robot.scene(file, None)?;
        let robots = scene.imports.reports();
        if robots.is_empty() {
            let right = "give a scene with a [[robot]], or a robot's file";
            return Err(Error::input(file.display().to_string(), "no robot", right));
        }
        output.result(&Robots { robots });
        return Ok(Exit::Done);
    }
    let water = Fluid::fresh_water();
    let density = arguments.density.unwrap_or(water.density);
    if !(density >= 0.0 && density.is_finite()) {
        let right = "give zero (no water) or more, in kg/m³";
        return Err(Error::input("--density", density, right));
    }
    let fluid = Fluid { density, ..water };
    let report = arguments
        .robot
        .robot(arguments.faces)
        .inspect(file, &fluid)?;
    output.result(&report);
    Ok(Exit::Done)
}
