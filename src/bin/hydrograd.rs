//! The command line of hydrograd; everything is in [`hydrograd::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    hydrograd::cli::main()
}
