//! The command line as a person or a script meets it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn hydrograd(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hydrograd"))
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn scene(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("examples/scenes")
        .join(name)
        .display()
        .to_string()
}

fn file(folder: &tempfile::TempDir, name: &str, contents: &str) -> String {
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, contents).unwrap();
    path.display().to_string()
}

/// Fails with this code and these words, without a panic, and with one JSON object if asked.
fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    let plain = hydrograd(arguments);
    let message = text(&plain.stderr);
    assert_eq!(plain.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    assert_eq!(text(&plain.stdout), "", "{arguments:?}");
    for word in words {
        assert!(
            message.contains(word),
            "{arguments:?}: no {word:?} in {message}"
        );
    }
    let json = hydrograd(&[arguments, &["--json"]].concat());
    assert_eq!(json.status.code(), Some(code));
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    let message = value["error"].as_str().unwrap();
    for word in words {
        assert!(
            message.contains(word),
            "{arguments:?}: no {word:?} in {message}"
        );
    }
}

#[test]
fn help_of_every_command_tells_flags_and_defaults() {
    let top = hydrograd(&["--help"]);
    assert!(top.status.success());
    let top = text(&top.stdout);
    let commands = [
        (
            "run",
            vec![
                "--fidelity",
                "--method",
                "--faces",
                "--integrator",
                "--steps",
                "--out",
            ],
        ),
        (
            "added-mass",
            vec!["--shape", "--density", "--fidelity", "--method", "--faces"],
        ),
        (
            "gradcheck",
            vec![
                "--steps",
                "--fidelity",
                "--integrator",
                "--method",
                "--faces",
            ],
        ),
        ("check-mesh", vec!["--scale"]),
    ];
    for (command, flags) in commands {
        assert!(top.contains(command), "{top}");
        let help = hydrograd(&[command, "--help"]);
        assert!(help.status.success());
        let help = text(&help.stdout);
        for flag in flags {
            assert!(help.contains(flag), "{command}: no {flag} in {help}");
        }
        assert!(
            help.contains("--json") && help.contains("[default"),
            "{help}"
        );
    }
    assert!(hydrograd(&["--version"]).status.success());
}

#[test]
fn wrong_usage_is_told_with_code_2() {
    fails(&["rum"], 2, &["rum", "run"]);
    fails(
        &["run", "x.toml", "--fidelity", "fulll"],
        2,
        &["fulll", "isolated", "full"],
    );
    fails(&["run", "x.toml", "--faces", "0"], 2, &["above zero"]);
    fails(&["run", "x.toml", "--tolerance", "-1"], 2, &["1e-8"]);
    fails(&["added-mass"], 2, &["--shape"]);
    fails(
        &["added-mass", "--shape", "spere:1"],
        2,
        &["spere", "sphere"],
    );
    fails(&["added-mass", "--shape", "sphere:-1"], 2, &["positive"]);
}

#[test]
fn bad_scenes_are_told_with_code_1() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["run", "gradcheck", "added-mass"] {
        let empty = file(&folder, "empty.toml", "");
        fails(&[command, &empty], 1, &["empty.toml", "time_step"]);
        let missing = folder.path().join("empti.toml").display().to_string();
        fails(
            &[command, &missing],
            1,
            &["empti.toml", "no such file", "empty.toml"],
        );
        let unknown = file(&folder, "unknown.toml", "time_stepp = 1\n");
        fails(
            &[command, &unknown],
            1,
            &["line 1", "time_stepp", "did you mean `time_step`"],
        );
        let negative = file(
            &folder,
            "negative.toml",
            "time_step = 1\nsteps = 1\n[fluid]\ndensity = 1\n[[bodies]]\nname = \"a\"\nmass = -1\n",
        );
        fails(&[command, &negative], 1, &["body \"a\": mass", "-1"]);
    }
    fails(
        &["run", &scene("cube.toml"), "--time-step", "0"],
        1,
        &["time_step", "above zero"],
    );
    fails(
        &["added-mass", &scene("cube.toml"), "--density=-2"],
        1,
        &["fluid.density", "-2"],
    );
    fails(
        &["added-mass", "notes.txt"],
        1,
        &["notes.txt", ".toml", ".obj"],
    );
    let taken = file(&folder, "taken", "");
    fails(
        &["run", &scene("cube.toml"), "--out", &taken],
        1,
        &["taken: write failed"],
    );
}

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                           f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn good_mesh_passes_the_check() {
    let folder = tempfile::tempdir().unwrap();
    let good = file(&folder, "good.obj", TETRAHEDRON);
    let plain = hydrograd(&["check-mesh", &good]);
    assert!(plain.status.success(), "{}", text(&plain.stderr));
    assert!(text(&plain.stdout).contains("4 faces"));
    let json = hydrograd(&["check-mesh", &good, "--json", "--scale", "0.1"]);
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(
        (value["ok"].as_bool(), value["faces"].as_u64()),
        (Some(true), Some(4))
    );
    let volume = value["volume"].as_f64().unwrap();
    assert!((volume - 1e-3 / 6.0).abs() < 1e-15);
}

#[test]
fn bad_mesh_fails_the_check_and_keeps_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let open = TETRAHEDRON.replace("f 2 3 4\n", "");
    let open = file(&folder, "open.obj", &open);
    let plain = hydrograd(&["check-mesh", &open]);
    assert_eq!(plain.status.code(), Some(1));
    assert!(text(&plain.stderr).contains("open.obj"));
    assert!(
        text(&plain.stdout).contains("3 edges"),
        "{}",
        text(&plain.stdout)
    );
    let json = hydrograd(&["--json", "check-mesh", &open]);
    assert_eq!(json.status.code(), Some(1));
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(value["ok"].as_bool(), Some(false));
    assert!(value["error"].as_str().unwrap().contains("open.obj"));
    assert!(!value["findings"].as_array().unwrap().is_empty());
    fails(&["check-mesh", "nowhere.stl"], 1, &["nowhere.stl"]);
}
