//! `hydrograd inspect`: what a robot in a URDF or MJCF file comes to.

use std::path::PathBuf;

use clap::Args;

use super::exit::Exit;
use super::options::RobotArguments;
use super::output::Output;
use crate::scene::Fluid;
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The robot (.urdf, .mjcf, .xml).
    #[arg(value_name = "ROBOT.urdf")]
    file: PathBuf,
    #[command(flatten)]
    robot: RobotArguments,
    /// Density of the water in kg/m³.
    #[arg(
        long,
        value_name = "RHO",
        default_value_t = 998.0,
        allow_negative_numbers = true
    )]
    density: f64,
}

/// Prints what a robot comes to.
pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    let density = arguments.density;
    if !(density >= 0.0 && density.is_finite()) {
        let right = "give zero (no water) or more, in kg/m³";
        return Err(Error::input("--density", density, right));
    }
    let fluid = Fluid {
        density,
        ..Fluid::fresh_water()
    };
    let report = arguments.robot.robot().inspect(&arguments.file, &fluid)?;
    output.result(&report);
    Ok(Exit::Done)
}
