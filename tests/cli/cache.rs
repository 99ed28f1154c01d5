//! The folder of compressed bodies under bad luck: many writers at once, ends at any byte, disks that are full.

use crate::support::command::{command, hydrograd};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const SHAPE: [&str; 9] = [
    "added-mass",
    "--shape",
    "box:0.1,0.2,0.3",
    "--faces",
    "40",
    "--fidelity",
    "reduced",
    "--json",
    "--cache",
];

fn arguments(folder: &str) -> Vec<&str> {
    [&SHAPE[..], &[folder]].concat()
}

/// The matrix to the last digit, and the warnings.
fn matrix(done: &Output) -> (String, Vec<String>) {
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let value: Value = serde_json::from_slice(&done.stdout).unwrap();
    let (matrix, warnings) = (&value["added_mass"], &value["warnings"]);
    assert!(matrix.is_array(), "{value}");
    let warnings = warnings.as_array().unwrap().iter();
    (
        matrix.to_string(),
        warnings.map(|w| w.to_string()).collect(),
    )
}

fn bodies(folder: &Path) -> Vec<PathBuf> {
    let all = std::fs::read_dir(folder).into_iter().flatten();
    let all = all.map(|f| f.unwrap().path());
    all.filter(|f| f.extension().is_some_and(|e| e == "body"))
        .collect()
}

#[test]
fn many_writers_leave_one_whole_file() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().display().to_string();
    let right = matrix(&hydrograd(&SHAPE[..8]));
    let mut other = SHAPE;
    other[2] = "box:0.1,0.2,0.301";
    assert_ne!(matrix(&hydrograd(&other[..8])).0, right.0);
    for _ in 0..3 {
        let mut command = command(&arguments(&place));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let writers: Vec<_> = (0..6).map(|_| command.spawn().unwrap()).collect();
        for writer in writers {
            assert_eq!(matrix(&writer.wait_with_output().unwrap()), right);
        }
        let kept = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!((kept, bodies(folder.path()).len()), (1, 1));
        // Damaged before the next ones come.
        let file = &bodies(folder.path())[0];
        let bytes = std::fs::read(file).unwrap();
        std::fs::write(file, &bytes[..bytes.len() / 2]).unwrap();
    }
}

/// The program is ended by the system as soon as a file is longer than so many blocks of 512 bytes, or is told that the disk is full.
#[cfg(unix)]
#[test]
fn a_writer_that_ends_anywhere_harms_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let right = matrix(&hydrograd(&SHAPE[..8]));
    let whole = folder.path().join("whole");
    hydrograd(&arguments(&whole.display().to_string()));
    let bytes = std::fs::read(&bodies(&whole)[0]).unwrap();
    let blocks = bytes.len() / 512;
    assert!(blocks > 8, "{blocks}");
    for (trap, told) in [("", false), ("trap '' XFSZ;", true)] {
        for block in [0, 1, 2, blocks / 2, blocks - 1, blocks] {
            let place = folder.path().join(format!("{told}-{block}"));
            let script = format!("{trap} ulimit -f {block}; exec \"$@\"");
            let mut limited = Command::new("sh");
            limited.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_hydrograd")]);
            let done = limited
                .args(arguments(&place.display().to_string()))
                .output()
                .unwrap();
            if told {
                let (found, warnings) = matrix(&done);
                assert_eq!(found, right.0);
                assert!(
                    warnings.iter().any(|w| w.contains("isn't kept")),
                    "{warnings:?}"
                );
                assert_eq!(std::fs::read_dir(&place).unwrap().count(), 0);
            } else {
                assert!(!done.status.success());
            }
            assert!(bodies(&place).is_empty());
            // The next one finds nothing wrong there.
            assert_eq!(
                matrix(&hydrograd(&arguments(&place.display().to_string()))),
                right
            );
            assert!(std::fs::read(&bodies(&place)[0]).unwrap() == bytes);
        }
    }
}

/// Ended from outside at moments spread over all that it does.
#[cfg(unix)]
#[test]
fn a_writer_that_is_killed_harms_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().display().to_string();
    let begun = std::time::Instant::now();
    let right = matrix(&hydrograd(&SHAPE[..8]));
    let whole = begun.elapsed();
    let mut kept = 0;
    for k in 0..12 {
        let mut command = command(&arguments(&place));
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let mut writer = command.spawn().unwrap();
        std::thread::sleep(whole * k / 10);
        writer.kill().unwrap();
        writer.wait().unwrap();
        for file in bodies(folder.path()) {
            kept += 1;
            std::fs::remove_file(file).unwrap();
        }
    }
    println!("{kept} of 12 writers came to their end");
    assert_eq!(matrix(&hydrograd(&arguments(&place))), right);
}
