//! The page on the command line is what the program says of itself.

#![cfg(feature = "cli")]

use std::path::Path;
use std::process::Command;

fn help(arguments: &[&str]) -> String {
    let program = env!("CARGO_BIN_EXE_hydrograd");
    let out = Command::new(program).args(arguments).output().unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    lines.join("\n").trim_end().to_string()
}

/// `HYDROGRAD_BLESS=1 cargo test --release --features cli --test source manual` writes it anew.
#[test]
fn the_page_on_the_command_line_is_what_the_program_says() {
    let mut page = format!(
        "# The command line\n\n`cargo install --path . --locked --features cli`, or the Python package, brings the program. It ends with 0 where all went well, \
         with 1 and a message on standard error where not, and with 2 where its arguments can't be read. Ctrl-C ends it with 130 at once; while `run` makes steps the first one waits for the step under way, what ran is \
         written, and it ends with 1.\n\n```text\n{}\n```\n",
        help(&["--help"])
    );
    for command in [
        "run",
        "added-mass",
        "gradcheck",
        "tradeoff",
        "inspect",
        "check-mesh",
        "gpu-info",
    ] {
        let text = help(&[command, "--help"]);
        page += &format!("\n## hydrograd {command}\n\n```text\n{text}\n```\n");
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/cli.md");
    if std::env::var_os("HYDROGRAD_BLESS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let written = std::fs::read_to_string(&file).unwrap();
    let differs = written.lines().zip(page.lines()).find(|(a, b)| a != b);
    assert!(
        written == page,
        "docs/cli.md, written by HYDROGRAD_BLESS=1 with this test: {differs:?}"
    );
}
