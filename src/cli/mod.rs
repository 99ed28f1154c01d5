//! The command line: `hydrograd run | added-mass | gradcheck | tradeoff | inspect | check-mesh | gpu-info`.
//!
//! Results go to standard output, everything else (progress, warnings, errors) to standard error.
//! With `--json` standard output holds one JSON object and nothing else: the result, or
//! `{"error": …}`. Exit codes: 0 done, 1 failed, 2 wrong usage.

mod added_mass;
mod check_mesh;
mod exit;
mod export;
mod gpu_info;
mod gradcheck;
mod inspect;
mod interrupt;
mod options;
mod output;
mod run;
mod tradeoff;
mod video;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use exit::Exit;
use output::Output;
pub use video::{Shown, Video, Videos};

/// Rigid bodies that feel each other through the water: simulation and exact gradients.
#[derive(Debug, Parser)]
#[command(
    name = "hydrograd",
    version,
    arg_required_else_help = true,
    after_help = "Units are SI throughout. `hydrograd COMMAND --help` tells all about a command."
)]
struct Cli {
    /// Print one JSON object on standard output and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate a scene; write and summarise its trajectory.
    Run(Box<run::Arguments>),
    /// Compute the added mass of all bodies of a scene, of a mesh, or of a shape by formula.
    AddedMass(added_mass::Arguments),
    /// Hold the gradient of a scene's trajectory against finite differences.
    Gradcheck(gradcheck::Arguments),
    /// Measure time against error over fidelities, methods, resolutions, integrators and time steps.
    Tradeoff(tradeoff::Arguments),
    /// Say what a robot in a URDF or MJCF file, or those of a scene, come to: its tree, weight against buoyancy, meshes that were replaced, and what wasn't used.
    Inspect(inspect::Arguments),
    /// Say whether a mesh can be simulated: what is wrong, where, and how to mend it.
    CheckMesh(check_mesh::Arguments),
    /// List the GPUs of this machine, and which one `--backend gpu` would use.
    GpuInfo(gpu_info::Arguments),
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    run(std::env::args_os().collect()).into()
}

/// Runs a command line; the first argument is the program's name.
pub fn run(arguments: Vec<OsString>) -> Exit {
    run_with(arguments, None)
}

/// The same, with what makes videos of runs. Without it a command that asks for one is handed to the Python package's program.
pub fn run_with(arguments: Vec<OsString>, videos: Option<&dyn Videos>) -> Exit {
    let asked_json = arguments.iter().any(|a| a == "--json");
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version come this way too; they belong on standard output.
            if !error.use_stderr() {
                output::print_text(&error.render().to_string());
                return match output::lost() {
                    true => Exit::Failed,
                    false => Exit::Done,
                };
            }
            let _ = error.print();
            if asked_json {
                output::print_error_object(error.to_string().trim());
            }
            return Exit::Usage;
        }
    };
    let output = Output { json: cli.json };
    let done = match cli.command {
        Command::Run(asked) if asked.asks_for_video() && videos.is_none() => {
            video::hand_over(&arguments)
        }
        Command::Run(arguments) => run::main(&arguments, videos, output),
        Command::AddedMass(arguments) => added_mass::main(&arguments, output),
        Command::Gradcheck(arguments) => gradcheck::main(&arguments, output),
        Command::Tradeoff(arguments) => tradeoff::main(&arguments, output),
        Command::Inspect(arguments) => inspect::main(&arguments, output),
        Command::CheckMesh(arguments) => check_mesh::main(&arguments, output),
        Command::GpuInfo(arguments) => gpu_info::main(&arguments, output),
    };
    let done = done.unwrap_or_else(|error| {
        output.error(&error);
        Exit::Failed
    });
    match output::lost() {
        true => Exit::Failed,
        false => done,
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }
}
