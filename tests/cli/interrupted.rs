//! Runs that end before their time: what they computed is kept, and gone on with to the bit.

use crate::support::command::{command, fails, hydrograd, json, scene};
use crate::support::{root, says};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn file(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}

fn words(path: &Path) -> String {
    path.display().to_string()
}

/// A scene with a controller that remembers.
fn base(ball: &str) -> Vec<&str> {
    vec!["run", ball, "--faces", "80", "--fidelity", "isolated"]
}

#[test]
fn a_run_goes_on_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (first, second, whole) = (
        words(&at("first")),
        words(&at("second")),
        words(&at("whole")),
    );
    let stopped = words(&file(&at("first"), "trajectory.json"));
    for (name, fidelity) in [
        ("falling_ball", "isolated"),
        ("gripper", "isolated"),
        ("two_spheres", "reduced"),
    ] {
        let scene = scene(name);
        let run = |more: &[&str]| {
            json(
                &[
                    &["run", &scene, "--faces", "80", "--fidelity", fidelity],
                    more,
                ]
                .concat(),
            )
        };
        run(&["--steps", "7", "--out", &first]);
        let late = run(&["--steps", "20", "--resume", &stopped, "--out", &second]);
        let once = run(&["--steps", "20", "--out", &whole]);
        assert_eq!(late["final_q"], once["final_q"]);
        assert_eq!((&late["steps"], &once["steps"]), (&13.into(), &20.into()));
        for name in ["trajectory.json", "trajectory.csv"] {
            let [a, b] = ["second", "whole"].map(|f| std::fs::read(file(&at(f), name)).unwrap());
            assert!(a == b, "{name}");
        }
        // Nothing left to do is done at once; fewer steps than were made can't be.
        let none = run(&["--steps", "7", "--resume", &stopped]);
        assert_eq!(none["steps"], 0);
        let arguments = [
            "run",
            &scene,
            "--faces",
            "80",
            "--fidelity",
            fidelity,
            "--resume",
            &stopped,
        ];
        fails(
            &[&arguments[..], &["--steps", "3"]].concat(),
            1,
            &["--resume", "7", "3"],
        );
        fails(
            &[&arguments[..], &["--time-step", "0.002"]].concat(),
            1,
            &["other settings"],
        );
    }
    let ball = scene("falling_ball");
    fails(
        &[&base(&ball)[..], &["--resume", &stopped]].concat(),
        1,
        &["another scene"],
    );
    // Whatever else is given for a trajectory is refused.
    let other = at("other.json");
    let text = std::fs::read_to_string(&stopped).unwrap();
    for (wrong, said) in [
        (String::new(), "EOF"),
        ("{}".into(), "no state"),
        (
            text.replace("\"y\":[", "\"y\":[1e400,"),
            "number out of range",
        ),
        (text.replace("\"q\":[[", "\"q\":[[0.0,"), "`q`"),
        (text.replace("\"time\":[", "\"time\":[0.0,"), "`q`"),
    ] {
        std::fs::write(&other, wrong).unwrap();
        let two = scene("two_spheres");
        let arguments = [
            "run",
            &two,
            "--faces",
            "80",
            "--fidelity",
            "reduced",
            "--resume",
            &words(&other),
        ];
        fails(&arguments, 1, &["other.json", said]);
    }
}

/// A mesh is what stands in its file, by whatever path that is found.
#[test]
fn a_run_goes_on_with_the_same_mesh_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mesh = at("cube.obj");
    std::fs::copy(root().join("tests/fuzz/corpus/mesh/cube.obj"), &mesh).unwrap();
    std::fs::create_dir(at("sub")).unwrap();
    let text = "time_step = 0.01\nsteps = 3\n[fluid]\ndensity = 0.0\n[[bodies]]\nname = \"cube\"\ndensity = 1000.0\n\
                shape = { kind = \"mesh\", path = \"cube.obj\" }\n";
    std::fs::write(at("scene.toml"), text).unwrap();
    let (scene, same) = (words(&at("scene.toml")), words(&at("sub/../scene.toml")));
    let (out, stopped) = (words(&at("out")), words(&at("out/trajectory.json")));
    json(&["run", &scene, "--out", &out]);
    let late = json(&["run", &same, "--steps", "5", "--resume", &stopped]);
    assert_eq!(late["steps"], 2);
    let whole = std::fs::read_to_string(&mesh).unwrap();
    std::fs::write(&mesh, whole + "# edited\n").unwrap();
    let arguments = ["run", &scene, "--steps", "5", "--resume", &stopped];
    fails(&arguments, 1, &["another scene"]);
}

/// Two balls that meet where surfaces may not.
const COLLISION: &str = r#"
time_step = 0.01
steps = 40
fluid = { density = 998.0 }
bodies = [
    { name = "left", shape = { kind = "sphere", radius = 0.1, faces = 80 }, density = 1000.0 },
    { name = "right", shape = { kind = "sphere", radius = 0.1, faces = 80 }, density = 1000.0, placement = { position = [0.25, 0.0, 0.0] } },
]
initial = { v = [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0] }
"#;

#[test]
fn a_run_that_fails_in_a_step_keeps_what_ran() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("meet.toml"), folder.path().join("out"));
    std::fs::write(&scene, COLLISION).unwrap();
    let (scene, written) = (words(&scene), words(&out));
    let arguments = [
        "run",
        &scene,
        "--fidelity",
        "reduced",
        "--no-films",
        "--out",
        &written,
    ];
    fails(
        &arguments,
        1,
        &["left", "right", "steps before are kept in", "--resume"],
    );
    let text = std::fs::read_to_string(out.join("trajectory.json")).unwrap();
    let kept: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rows = kept["time"].as_array().unwrap().len();
    assert!((3..40).contains(&rows), "{rows}");
    assert_eq!(kept["q"].as_array().unwrap().len(), rows);
    let whole = json(&[
        "run",
        &scene,
        "--fidelity",
        "reduced",
        "--no-films",
        "--steps",
        &format!("{}", rows - 1),
    ]);
    assert_eq!(whole["final_q"], kept["q"][rows - 1]);
    fails(&arguments[..5], 1, &["nothing is kept without --out"]);
}

/// A file in the place of a folder of VTK's, which is found out when that is written.
fn in_the_way(folder: &Path) -> [String; 2] {
    let vtk = folder.join("vtk");
    std::fs::create_dir(&vtk).unwrap();
    std::fs::write(vtk.join("bodies"), "in the way").unwrap();
    [words(&vtk), words(&folder.join("run.glb"))]
}

#[test]
fn files_that_cannot_be_written_cost_nothing_else_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let [vtk, gltf] = in_the_way(folder.path());
    let ball = scene("falling_ball");
    let asked = ["--steps", "3", "--vtk", &vtk, "--gltf", &gltf];
    let asked = [&base(&ball)[..], &asked].concat();
    for form in [&[][..], &["--json"]] {
        let done = hydrograd(&[&asked[..], form].concat());
        let said = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(1), "{said}");
        says(said, &["bodies: write failed"]);
        assert!(Path::new(&gltf).is_file());
        std::fs::remove_file(&gltf).unwrap();
        let text = String::from_utf8(done.stdout).unwrap();
        if form.is_empty() {
            says(text, &["smallest gap", "run.glb"]);
            continue;
        }
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(report["steps"], 3);
        assert_eq!(report["files"].as_array().unwrap().len(), 1);
        says(&report["lost"][0], &["bodies: write failed"]);
    }
}

#[test]
fn a_run_that_fails_and_cannot_be_exported_tells_programs_once() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("meet.toml");
    std::fs::write(&scene, COLLISION).unwrap();
    let [vtk, gltf] = in_the_way(folder.path());
    let scene = words(&scene);
    let run = ["run", &scene, "--fidelity", "reduced", "--no-films"];
    let asked = ["--vtk", &vtk, "--gltf", &gltf, "--json"];
    let done = hydrograd(&[&run[..], &asked].concat());
    assert_eq!(done.status.code(), Some(1));
    let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    says(&told["error"], &["left", "right", "nothing is kept"]);
    let said = String::from_utf8(done.stderr).unwrap();
    says(said, &["bodies: write failed", "nothing is kept"]);
    assert!(Path::new(&gltf).is_file());
}

/// Two balls beside each other, and a body that panels can't take: its added mass is given without a shape.
const UNSEEN: &str = r#"
time_step = 0.01
steps = 2
fluid = { density = 998.0 }
[[bodies]]
name = "left"
shape = { kind = "sphere", radius = 0.1, faces = 80 }
density = 998.0
[[bodies]]
name = "right"
shape = { kind = "sphere", radius = 0.1, faces = 80 }
density = 998.0
placement = { position = [0.25, 0.0, 0.0] }
[[bodies]]
name = "buoy"
mass = 1.0
inertia = [0.1, 0.1, 0.1]
added_mass = [
    [0.001, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.001, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.001, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.001, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.001, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.001],
]
placement = { position = [0.0, 2.0, 0.0] }
"#;

#[test]
fn a_check_of_the_gap_that_fails_costs_nothing_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("unseen.toml"), folder.path().join("out"));
    std::fs::write(&scene, UNSEEN).unwrap();
    let (scene, written) = (words(&scene), words(&out));
    let run = ["run", &scene, "--fidelity", "isolated", "--check-gap"];
    let report = json(&[&run[..], &["--out", &written]].concat());
    assert!(report["gap_check"].is_null() && report["min_gap"].is_number());
    let warnings = report["warnings"].to_string();
    says(&warnings, &["--check-gap", "buoy", "no shape"]);
    assert_eq!(report["files"].as_array().unwrap().len(), 2);
    assert!(out.join("trajectory.json").is_file() && out.join("trajectory.csv").is_file());
}

/// What an interrupt leaves goes on to what would have been without it.
#[cfg(unix)]
#[test]
fn an_interrupted_run_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (out, whole) = (folder.path().join("out"), folder.path().join("whole"));
    let ball = scene("falling_ball");
    let written = words(&out);
    let long = ["--steps", "200000", "--out", &written];
    for signal in ["-INT", "-TERM"] {
        let child = command(&[&base(&ball)[..], &long].concat())
            .stderr(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(1500));
        let asked = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status();
        assert!(asked.unwrap().success());
        let done: Output = child.wait_with_output().unwrap();
        let said = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(1), "{said}");
        says(
            &said,
            &[
                "stopped as asked",
                "steps before are kept in",
                "ending after this step",
            ],
        );
        let stopped = words(&out.join("trajectory.json"));
        let kept: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&stopped).unwrap()).unwrap();
        let steps = kept["time"].as_array().unwrap().len() - 1;
        assert!(steps > 10 && steps < 200_000, "{steps}");
        let more = (steps + 5).to_string();
        let resumed = ["--steps", &more, "--resume", &stopped, "--out", &written];
        json(&[&base(&ball)[..], &resumed].concat());
        json(
            &[
                &base(&ball)[..],
                &["--steps", &more, "--out", &words(&whole)],
            ]
            .concat(),
        );
        let [a, b] = [&out, &whole].map(|f| std::fs::read(f.join("trajectory.json")).unwrap());
        assert!(a == b);
    }
}

/// A full disk leaves the old files as they were, and a folder that can't take them isn't the end of a run.
#[cfg(unix)]
#[test]
fn what_cannot_be_written_costs_neither_old_files_nor_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let ball = scene("falling_ball");
    let written = words(&out);
    let arguments = [&base(&ball)[..], &["--steps", "30", "--out", &written]].concat();
    assert!(hydrograd(&arguments).status.success());
    let files =
        || ["trajectory.csv", "trajectory.json"].map(|name| std::fs::read(out.join(name)).unwrap());
    let before = files();
    // No file may grow past a block of 512 bytes: writing fails as on a full disk, or ends the program.
    for (trap, codes) in [
        ("trap '' XFSZ;", [Some(1), Some(1)]),
        ("", [None, Some(153)]),
    ] {
        let script = format!("{trap} ulimit -f 1; exec \"$@\"");
        let program = env!("CARGO_BIN_EXE_hydrograd");
        let done = Command::new("sh")
            .args(["-c", &script, "sh", program])
            .args(&arguments)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(
            codes.contains(&done.status.code()),
            "{:?}: {said}",
            done.status
        );
        if !trap.is_empty() {
            says(&said, &["trajectory", "write failed"]);
            let left = std::fs::read_dir(&out).unwrap().count();
            assert_eq!(left, 2, "no temporary files stay behind");
        }
        assert!(files() == before);
    }
    // A folder stands where the file should be.
    std::fs::remove_file(out.join("trajectory.json")).unwrap();
    std::fs::create_dir_all(out.join("trajectory.json/full")).unwrap();
    let done = hydrograd(&arguments);
    let said = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1));
    let (_, place) = said.split_once("the run is kept in ").unwrap();
    let place = PathBuf::from(place.split_once(" instead").unwrap().0);
    assert!(std::fs::read(place.join("trajectory.json")).unwrap() == before[1]);
    std::fs::remove_dir_all(place).unwrap();
}

/// Help that is lost is a failure as well.
#[cfg(target_os = "linux")]
#[test]
fn lost_help_is_a_failure() {
    for arguments in [&["--help"][..], &["--version"], &["run", "--help"]] {
        let full = std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let done = command(arguments).stdout(full).output().unwrap();
        assert_eq!(done.status.code(), Some(1), "{arguments:?}");
        says(String::from_utf8_lossy(&done.stderr), &["standard output"]);
    }
}
