//! `--video` of a program that isn't the Python package's: it hands the command on, or says what it needs. What the package makes of it is tested in Python.

use crate::support::command::{command, fails, hydrograd, scene};
use crate::support::says;

/// A Python that can't be one, so that nothing depends on what this machine has.
fn refuses(python: &str, words: &[&str]) {
    let ball = scene("falling_ball");
    let done = command(&["run", &ball, "--steps", "1000000", "--video", "run.mp4"])
        .env("HYDROGRAD_PYTHON", python)
        .output()
        .unwrap();
    let said = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1), "{said}");
    says(&said, words);
    assert!(done.stdout.is_empty(), "nothing has run");
}

#[test]
fn without_the_package_it_says_what_it_needs() {
    let needed = "pip install '.[video]'";
    refuses(
        "no-such-python",
        &["--video", needed, "no-such-python doesn't start"],
    );
}

#[test]
fn wrong_videos_are_refused() {
    let ball = scene("falling_ball");
    let of = |flag: &str, value: &str, words: &[&str]| {
        let words = [&[flag][..], words].concat();
        let arguments = ["run", &ball, "--video", "run.mp4", flag, value];
        fails(&arguments, 2, &words);
    };
    for wrong in ["0", "-1", "nan"] {
        of("--video-fps", wrong, &["above zero"]);
        of("--video-speed", wrong, &["above zero"]);
        of("--video-zoom", wrong, &["above zero"]);
    }
    for wrong in ["1280", "x", "1280x-2", "1.5x2"] {
        of("--video-size", wrong, &["width and height in pixels"]);
    }
    for wrong in ["1,2", "0,0,0", "1,2,nan", "up"] {
        of("--video-view", wrong, &["three numbers"]);
    }
    of(
        "--video-show",
        "pressure,colour",
        &["colour", "streamlines"],
    );
    let alone = ["run", &ball, "--video-fps", "30"];
    fails(&alone, 2, &["--video"]);
    assert!(!hydrograd(&alone).status.success());
}

#[cfg(unix)]
mod with_a_package {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;

    /// A Python that says its package's version, and what it is asked to run.
    fn python(folder: &Path, version: &str, code: i32) -> String {
        let path = folder.join("python");
        let script = format!(
            "#!/bin/sh\nif [ \"$1\" = -c ]; then {version}; else echo \"$@\"; exit {code}; fi\n"
        );
        fs::write(&path, script).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        path.display().to_string()
    }

    #[test]
    fn the_command_is_handed_on() {
        let folder = tempfile::tempdir().unwrap();
        let version = format!("echo {}", env!("CARGO_PKG_VERSION"));
        for code in [0, 1, 2] {
            let python = python(folder.path(), &version, code);
            let asked = ["run", "some scene.toml", "--video", "a.webm", "--json"];
            let done = command(&asked).env("HYDROGRAD_PYTHON", python).output();
            let done = done.unwrap();
            assert_eq!(done.status.code(), Some(code));
            let said = String::from_utf8(done.stdout).unwrap();
            assert_eq!(said, format!("-m hydrograd {}\n", asked.join(" ")));
        }
    }

    #[test]
    fn not_to_another_version() {
        let folder = tempfile::tempdir().unwrap();
        refuses(
            &python(folder.path(), "echo 0.1.0", 0),
            &["has version 0.1.0"],
        );
        let without = "echo \"No module named 'hydrograd'\" >&2; exit 1";
        refuses(
            &python(folder.path(), without, 0),
            &["doesn't have it: No module named 'hydrograd'"],
        );
    }
}
