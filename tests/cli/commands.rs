//! Every command but `tradeoff`.

use crate::support::command::{fails, hydrograd, json, scene, text as said};
use std::path::{Path, PathBuf};

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn file(folder: &tempfile::TempDir, name: &str, contents: &str) -> String {
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, contents).unwrap();
    path.display().to_string()
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
                "--backend",
                "--gpu-fallback",
            ],
        ),
        (
            "added-mass",
            vec![
                "--shape",
                "--density",
                "--fidelity",
                "--method",
                "--faces",
                "--estimate",
            ],
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
        ("gpu-info", vec!["--adapter", "--gpu-arithmetic"]),
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
        &["run", &scene("cube"), "--time-step", "0"],
        1,
        &["time_step", "above zero"],
    );
    fails(
        &["added-mass", &scene("cube"), "--density=-2"],
        1,
        &["fluid.density", "-2"],
    );
    fails(
        &["added-mass", "notes.txt"],
        1,
        &["notes.txt", ".toml", ".mjcf", ".obj", ".dae"],
    );
    let taken = file(&folder, "taken", "");
    fails(
        &["run", &scene("cube"), "--out", &taken],
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
    // Four faces are few for the water.
    assert!(text(&plain.stdout).contains("into which they are divided"));
    let water = &value["water"];
    assert!(water["faces"].as_u64().unwrap() > 500);
    assert_eq!(water["coarse"].as_bool(), Some(false));
    let edge = |name: &str| water[name].as_f64().unwrap();
    assert!(edge("divided_edge") <= edge("asked_edge"));
    assert!((edge("longest_edge") - 0.1 * 2.0_f64.sqrt()).abs() < 1e-12);
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
    // A second one through the first.
    let second = "v 0.1 0.1 0.1\nv 1.1 0.1 0.1\nv 0.1 1.1 0.1\nv 0.1 0.1 1.1\nf 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n";
    let crossing = file(&folder, "crossing.obj", &[TETRAHEDRON, second].concat());
    let words = [
        "crossing.obj",
        "pass through each other",
        "3 with 4",
        "hull",
    ];
    for command in ["check-mesh", "added-mass"] {
        let done = hydrograd(&[command, &crossing]);
        assert_eq!(done.status.code(), Some(1));
        let said = text(&done.stderr);
        assert!(words.iter().all(|w| said.contains(w)), "{said}");
    }
}

#[test]
fn the_hull_of_a_bad_mesh_can_be_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let open = file(&folder, "open.obj", &TETRAHEDRON.replace("f 2 3 4\n", ""));
    let hull = folder.path().join("hull.stl").display().to_string();
    let done = hydrograd(&["--json", "check-mesh", &open, "--hull", &hull]);
    assert_eq!(done.status.code(), Some(1));
    let value: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(value["hull"]["faces"].as_u64(), Some(4));
    assert!((value["hull"]["volume"].as_f64().unwrap() - 1.0 / 6.0).abs() < 1e-15);
    for hull in [hull.clone(), hull.replace(".stl", ".obj")] {
        hydrograd(&["check-mesh", &open, "--hull", &hull]);
        let again = hydrograd(&["check-mesh", &hull]);
        assert!(again.status.success(), "{}", text(&again.stderr));
    }
    let flat = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
    let flat = file(&folder, "flat.obj", flat);
    fails(
        &["check-mesh", &flat, "--hull", &hull],
        1,
        &["flat.obj", "no hull with a volume"],
    );
    fails(
        &["check-mesh", &open, "--hull", "hull.off"],
        1,
        &["hull.off", ".stl"],
    );
    // Not in the place of the mesh itself, by whatever path.
    let before = std::fs::read(&open).unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    let around = folder.path().join("sub/../open.obj").display().to_string();
    for same in [&open, &around] {
        let words = ["--hull", "open.obj", "the mesh that is checked"];
        fails(&["check-mesh", &open, "--hull", same], 1, &words);
    }
    assert!(std::fs::read(&open).unwrap() == before);
}

/// All these keys hold finite numbers.
fn numbers(value: &serde_json::Value, keys: &[&str]) {
    for key in keys {
        let number = value[key].as_f64();
        assert!(
            number.is_some_and(f64::is_finite),
            "{key} is {}",
            value[key]
        );
    }
}

fn list(value: &serde_json::Value) -> Vec<f64> {
    let items = value.as_array().unwrap().iter();
    items.map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn run_summarises_and_writes_the_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    let ball = scene("falling_ball");
    for fidelity in ["full", "isolated"] {
        let arguments = [
            "run",
            &ball,
            "--faces",
            "80",
            "--steps",
            "6",
            "--fidelity",
            fidelity,
            "--out",
            &out,
        ];
        let first = json(&arguments);
        numbers(
            &first,
            &[
                "steps",
                "dt",
                "seconds",
                "setup_seconds",
                "seconds_per_step",
                "energy_initial",
                "energy_final",
                "energy_gain",
                "energy_loss",
                "momenta_kept",
                "min_gap",
                "cut_steps",
                "most_pieces",
            ],
        );
        assert_eq!(first["fidelity"], fidelity);
        assert_eq!(
            (first["steps"].as_u64(), first["dt"].as_f64()),
            (Some(6), Some(0.01))
        );
        assert_eq!(list(&first["final_q"]).len(), 4);
        assert_eq!(list(&first["final_v"]).len(), 4);
        assert!(first["warnings"].is_array() && first.get("peak_memory_mb").is_some());
        // A number where nothing outside acts in some direction, null where it does in all.
        let kept = first["momenta_kept"].as_u64() > Some(0);
        assert_eq!(first["momentum_drift"].is_number(), kept);

        let file = Path::new(&out).join("trajectory.json");
        let trajectory = std::fs::read_to_string(file).unwrap();
        let trajectory: serde_json::Value = serde_json::from_str(&trajectory).unwrap();
        for key in ["time", "q", "v", "energy", "momentum", "min_gap"] {
            assert_eq!(trajectory[key].as_array().unwrap().len(), 7, "{key}");
        }
        assert_eq!(trajectory["coordinates"][3], "coin.angle");
        assert_eq!(list(&trajectory["q"][6]), list(&first["final_q"]));
        assert_eq!(list(&trajectory["momentum"][6]).len(), 6);
        let csv = std::fs::read_to_string(Path::new(&out).join("trajectory.csv")).unwrap();
        let rows: Vec<Vec<&str>> = csv.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(rows.len(), 8);
        assert_eq!(trajectory["controls"][0], rows[0][19]);
        let controls = trajectory["controls"].as_array().unwrap().len();
        assert!(controls > 0 && rows.iter().all(|r| r.len() == 19 + controls));
        // At the last state no step begins, and nothing acts.
        let acted = trajectory["applied_controls"].as_array().unwrap();
        for (r, acted) in rows[1..].iter().zip(acted) {
            let cells = r[19..].iter().map(|x| x.parse::<f64>().ok());
            let acted = acted.as_array().unwrap().iter().map(|x| x.as_f64());
            assert!(cells.eq(acted));
        }
        let acts = |r: &Vec<&str>| r[19..].iter().all(|x| !x.is_empty());
        assert!(rows[1..7].iter().all(acts) && !acts(&rows[7]));
        assert!(
            rows[1..]
                .iter()
                .flat_map(|r| &r[..17])
                .all(|x| x.parse::<f64>().is_ok_and(f64::is_finite))
        );
        // Errors are estimated where bodies are coupled.
        let estimated = |r: &Vec<&str>| r[17..19].iter().all(|x| x.parse::<f64>().is_ok());
        assert!(
            rows[1..]
                .iter()
                .all(|r| estimated(r) == (fidelity != "isolated"))
        );

        let second = json(&arguments);
        assert_eq!(
            first["final_q"].to_string(),
            second["final_q"].to_string(),
            "equal runs, equal bits"
        );
    }
    let plain = hydrograd(&["run", &ball, "--faces", "80", "--steps", "1"]);
    assert!(text(&plain.stdout).contains("smallest gap"));
}

#[test]
fn settings_reach_the_simulator() {
    let ball = scene("falling_ball");
    let base = ["run", &ball, "--faces", "80", "--steps", "2"];
    let paper = json(&[&base[..], &["--preset", "paper"]].concat());
    assert_eq!(
        (&paper["method"], &paper["integrator"]),
        (&"mfs-face".into(), &"velocity-euler".into())
    );
    let mixed = json(&[&base[..], &["--preset", "paper", "--integrator", "rk4"]].concat());
    assert_eq!(
        (&mixed["method"], &mixed["integrator"]),
        (&"mfs-face".into(), &"rk4".into())
    );
    let default = json(&base);
    assert_eq!(
        (
            &default["fidelity"],
            &default["fidelity_used"],
            &default["method"]
        ),
        (&"auto".into(), &"reduced".into(), &"auto".into())
    );
    let base = [&base[..], &["--fidelity", "full"]].concat();
    let plain = json(&base);
    assert_eq!(
        (&plain["method"], &plain["integrator"]),
        (&"panel".into(), &"rk4".into())
    );
    // What is factored takes no iterations, and has the same solution.
    let asked = ["added-mass", &ball, "--faces", "80", "--fidelity", "full"];
    let iterated = json(&asked);
    let direct = json(&[&asked[..], &["--solver", "qr"]].concat());
    assert!(iterated["iterations"].as_u64() > Some(0), "{iterated}");
    assert_eq!(direct["iterations"], 0);
    let [a, b] = [iterated, direct].map(|r| r["added_mass"][0][0].as_f64().unwrap());
    assert!((a / b - 1.0).abs() <= 1e-6, "{a} {b}");
    fails(
        &[&base[..], &["--solver", "gmres", "--method", "mfs-vertex"]].concat(),
        1,
        &["GMRES", "mfs-face"],
    );
}

#[test]
fn the_smallest_gap_is_compared_with_panels() {
    let ball = scene("falling_ball");
    let run = ["run", &ball, "--faces", "80", "--steps", "2"];
    assert!(json(&run)["gap_check"].is_null());
    let checked = json(&[&run[..], &["--check-gap"]].concat());
    let check = &checked["gap_check"];
    assert_eq!(check["gap"], checked["min_gap"]);
    for error in ["added_mass_error", "force_error"] {
        assert!(check[error].as_f64().unwrap().abs() < 0.2, "{error}");
    }
    let panels = |of: &str| check[of][1].as_f64().unwrap();
    let share = panels("slope").abs() * check["gap"].as_f64().unwrap() / panels("added_mass");
    let told = check["force_share"].as_f64().unwrap();
    assert!(told > 0.0 && (told / share - 1.0).abs() < 1e-9, "{told}");
    let plain = hydrograd(&[&run[..], &["--check-gap"]].concat());
    crate::support::says(
        text(&plain.stdout),
        &["against coupled panels", "% of M u²/2h"],
    );
}

#[test]
fn added_mass_of_a_sphere() {
    let report = json(&["added-mass", "--shape", "sphere:1", "--density", "1000"]);
    numbers(
        &report,
        &[
            "asymmetry",
            "volume",
            "faces",
            "unknowns",
            "iterations",
            "seconds",
        ],
    );
    assert_eq!(report["bodies"], serde_json::json!(["sphere"]));
    assert_eq!(report["faces"], 1280);
    let rows: Vec<_> = report["added_mass"]
        .as_array()
        .unwrap()
        .iter()
        .map(list)
        .collect();
    assert!(rows.len() == 6 && rows.iter().all(|r| r.len() == 6));
    let exact = 2.0 / 3.0 * std::f64::consts::PI * 1000.0;
    for (i, row) in rows.iter().enumerate() {
        for (j, x) in row.iter().enumerate() {
            let expected = if i == j && i < 3 { exact } else { 0.0 };
            assert!((x - expected).abs() <= 0.01 * exact, "{i} {j}: {x}");
        }
    }
    let fresh = json(&["added-mass", "--shape", "sphere:1", "--faces", "80"]);
    assert_eq!(fresh["density"], 998.0);
}

#[test]
fn added_mass_of_scenes_and_meshes() {
    // Bodies that nothing moves belong to the coupled matrix.
    let floor = scene("falling_ball_box");
    let report = json(&["added-mass", &floor, "--faces", "80"]);
    let rows: Vec<_> = report["added_mass"]
        .as_array()
        .unwrap()
        .iter()
        .map(list)
        .collect();
    assert_eq!(report["bodies"].as_array().unwrap().len(), 3);
    assert_eq!((rows.len(), rows[0].len()), (18, 18));
    for (i, row) in rows.iter().enumerate() {
        assert!((0..18).all(|j| row[j] == rows[j][i]));
    }
    assert!((0..3).chain(12..18).all(|i| rows[i][i] > 0.0));
    let alone = json(&[
        "added-mass",
        &floor,
        "--faces",
        "80",
        "--fidelity",
        "isolated",
    ]);
    assert_eq!(alone["bodies"], serde_json::json!(["sphere", "coin"]));
    assert!(alone["warnings"].to_string().contains("floor"));

    let folder = tempfile::tempdir().unwrap();
    // A robot by any of the names that other commands know; half the water that a sphere displaces.
    let pod = "<mujoco model=\"pod\"><worldbody><body name=\"pod\"><freejoint/><geom type=\"sphere\" size=\"0.1\" density=\"1000\"/></body></worldbody></mujoco>";
    for name in ["pod.xml", "pod.mjcf"] {
        let robot = file(&folder, name, pod);
        let report = json(&["added-mass", &robot, "--fidelity", "isolated"]);
        assert_eq!(report["bodies"], serde_json::json!(["pod"]));
        let half = 0.5 * 998.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-3;
        let found = report["added_mass"][0][0].as_f64().unwrap();
        assert!((found / half - 1.0).abs() < 0.05, "{found} for {half}");
    }
    let good = file(&folder, "corner.obj", TETRAHEDRON);
    let choices = ["choices for a robot's file", ".urdf", "leave them out"];
    fails(
        &["added-mass", &good, "--wet", "none", "--bad-meshes=refuse"],
        1,
        &[&choices[..], &["corner.obj"]].concat(),
    );
    fails(
        &["added-mass", "--shape", "sphere:0.5", "--base", "fixed"],
        1,
        &[&choices[..], &["--shape"]].concat(),
    );
    let report = json(&["added-mass", &good]);
    assert_eq!(report["bodies"], serde_json::json!(["corner"]));
    assert!((report["volume"].as_f64().unwrap() - 1.0 / 6.0).abs() < 1e-12);
    // Every face's corners in the other order: inside out.
    let inverted: String = TETRAHEDRON
        .lines()
        .map(|l| match l.split(' ').collect::<Vec<_>>()[..] {
            ["f", a, b, c] => format!("f {a} {c} {b}\n"),
            _ => format!("{l}\n"),
        })
        .collect();
    let inverted = file(&folder, "inverted.obj", &inverted);
    fails(&["added-mass", &inverted], 1, &["inverted.obj", "inward"]);
}

#[test]
fn added_mass_with_an_estimate_of_its_error() {
    let asked = ["added-mass", "--shape", "sphere:1", "--density", "1"];
    let asked = [&asked[..], &["--method", "panel", "--faces", "320"]].concat();
    let report = json(&[&asked[..], &["--estimate"]].concat());
    let estimate = &report["error_estimate"];
    numbers(estimate, &["total", "asymmetry", "extrapolation", "solver"]);
    assert_eq!(estimate["missing"].as_array().unwrap().len(), 0);
    let total = estimate["total"].as_f64().unwrap();
    let found = report["added_mass"][0][0].as_f64().unwrap();
    let error = (found / (2.0 / 3.0 * std::f64::consts::PI) - 1.0).abs();
    assert!(error < total && total < 3.0 * error, "{total} {error}");
    // Only when asked for; and for people.
    assert!(json(&asked).get("error_estimate").is_none());
    let plain = hydrograd(&[&asked[..], &["--estimate"]].concat());
    assert!(text(&plain.stdout).contains("estimated error 1.0e-3"));
    let floor = scene("falling_ball");
    let alone = ["added-mass", &floor, "--fidelity", "isolated", "--estimate"];
    let report = json(&[&alone[..], &["--faces", "320"]].concat());
    numbers(&report["error_estimate"], &["total", "coupling"]);
}

#[test]
fn gradcheck_passes_and_tells_its_cost() {
    let ellipsoid = scene("kirchhoff_ellipsoid");
    let base = ["gradcheck", &ellipsoid, "--faces", "80", "--steps", "4"];
    for fidelity in ["full", "isolated"] {
        let report = json(&[&base[..], &["--fidelity", fidelity]].concat());
        numbers(
            &report,
            &[
                "max_rel_error",
                "rel_error_initial",
                "rel_error_parameters",
                "forward_seconds",
                "gradient_seconds",
                "ratio",
            ],
        );
        assert!(report["rel_error_controls"].is_null());
        assert!(report["max_rel_error"].as_f64().unwrap() <= 1e-6);
        assert_eq!(report["ok"], true);
        assert_eq!(report["tolerance"], 1e-12);
        let growth = &report["growth"];
        numbers(growth, &["total", "duration"]);
        numbers(&growth["largest_step"], &["factor", "time"]);
        numbers(&growth["peak"], &["factor", "time"]);
        assert!(growth["total"].as_f64().unwrap() > 1.0);
        assert!(report["advice"].is_null());
    }
    let plain = hydrograd(&base);
    let said = text(&plain.stdout);
    assert!(said.contains("pass") && said.contains("grows by at most"));
    let without = json(&[&base[..], &["--no-growth"]].concat());
    assert!(without["growth"].is_null());
    // A pencil on its tip: changes grow by e^(√(g/l) t).
    let folder = tempfile::tempdir().unwrap();
    let pencil = file(&folder, "pencil.toml", PENCIL);
    let report = json(&["gradcheck", &pencil]);
    let total = report["growth"]["total"].as_f64().unwrap();
    assert!((100.0..1e4).contains(&total), "{total}");
    assert!(report["advice"].to_string().contains("multiple shooting"));
    let plain = hydrograd(&["gradcheck", &pencil]);
    assert!(text(&plain.stdout).contains("clip the gradient"));
    // A solve to one digit can't agree with its own differences.
    let ball = scene("falling_ball");
    let loose = hydrograd(&[
        "gradcheck",
        &ball,
        "--faces",
        "80",
        "--steps",
        "2",
        "--fidelity",
        "full",
        "--tolerance",
        "0.1",
        "--json",
    ]);
    let report: serde_json::Value = serde_json::from_slice(&loose.stdout).unwrap();
    assert_eq!(report["ok"], false, "{report}");
    assert_eq!(loose.status.code(), Some(1));
    crate::support::says(
        text(&loose.stderr),
        &["the gradient isn't", "the limit is 1e-6"],
    );
}

const PENCIL: &str = r#"
time_step = 0.01
steps = 150
gravity = [0.0, 0.0, -9.81]
[fluid]
density = 0.0
[[bodies]]
name = "pencil"
mass = 2.0
inertia = [0.0, 0.0, 0.0]
center_of_mass = [0.0, 0.0, 0.5]
joint = { kind = "revolute", axis = [1.0, 0.0, 0.0] }
"#;

const TWO_SPHERES: &str = r#"
time_step = 0.05
steps = 20
[fluid]
density = 998.0
[[bodies]]
name = "mover"
shape = { kind = "sphere", radius = 0.1, faces = 80 }
density = 998.0
[[bodies]]
name = "target"
shape = { kind = "sphere", radius = 0.1, faces = 80 }
density = 998.0
placement = { position = [0.3, 0.0, 0.0] }
[initial]
v = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
"#;

#[test]
fn bodies_in_one_another_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let apart = file(&folder, "apart.toml", TWO_SPHERES);
    fails(
        &["run", &apart],
        1,
        &["mover", "target", "at t = 0.", "the scene has no contact"],
    );
    let report = json(&["run", &apart, "--fidelity", "isolated"]);
    assert!(report["warnings"].to_string().contains("overlap"));
    assert!(report["min_gap"].as_f64().unwrap() < 0.0);
    let near = TWO_SPHERES
        .replace("v = [1.0", "v = [0.0")
        .replace("[0.3,", "[0.202,");
    let near = file(&folder, "near.toml", &near);
    let report = json(&["run", &near, "--steps", "1", "--no-films"]);
    let said = report["warnings"].to_string();
    assert!(
        said.contains("narrowest against what is resolved") && said.contains("compressed sources"),
        "{said}"
    );

    let inside = file(
        &folder,
        "inside.toml",
        &TWO_SPHERES.replace("[0.3,", "[0.15,"),
    );
    let wall = "[[walls]]\npoint = [0.0, 0.0, -0.09]\nnormal = [0.0, 0.0, 1.0]\n[[bodies]]";
    let sunk = file(
        &folder,
        "sunk.toml",
        &TWO_SPHERES.replacen("[[bodies]]", wall, 1),
    );
    let rigid = TWO_SPHERES.replace("[0.3,", "[0.15,").replace(
        "placement",
        "joint = { kind = \"fixed\" }\nparent = \"mover\"\nplacement",
    );
    let rigid = rigid.replace("0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n", "]\n");
    let rigid = file(&folder, "rigid.toml", &rigid);
    for command in ["run", "added-mass", "gradcheck"] {
        fails(&[command, &inside], 1, &["mover", "target", "overlap"]);
        fails(&[command, &sunk], 1, &["mover", "wall 0"]);
        fails(&[command, &rigid], 1, &["mover", "target", "overlap"]);
    }
}

#[test]
fn bad_starts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let short = format!("{TWO_SPHERES}q = [0.0, 0.0, 0.0]\n");
    let short = file(&folder, "short.toml", &short);
    for command in ["run", "gradcheck"] {
        fails(&[command, &short], 1, &["initial", "q", "14"]);
        let still = TWO_SPHERES.replace("time_step = 0.05", "time_step = 0.0");
        let still = file(&folder, "still.toml", &still);
        fails(&[command, &still], 1, &["time_step", "above zero"]);
    }
    let good = file(&folder, "good.toml", TWO_SPHERES);
    fails(
        &["gradcheck", &good, "--steps", "0"],
        1,
        &["steps", "at least 1"],
    );
    fails(
        &["gradcheck", &good, "--directions", "0"],
        2,
        &["above zero"],
    );
}

/// Without the feature the GPU's flags are there and say what to build.
#[test]
#[cfg(not(feature = "gpu"))]
fn a_build_without_the_gpu_says_how_to_get_it() {
    let ball = scene("falling_ball");
    let small = ["--faces", "80", "--backend", "gpu"];
    let words = [
        "backend gpu",
        "feature gpu",
        "cargo build --release --features gpu",
    ];
    for command in ["run", "gradcheck", "added-mass"] {
        for fidelity in ["isolated", "full"] {
            let asked = [&[command, &ball, "--fidelity", fidelity][..], &small].concat();
            fails(&asked, 1, &words);
        }
    }
    fails(&["gpu-info"], 1, &words);
    // With the fallback it runs, on the CPU, and says why.
    let run = ["run", &ball, "--steps", "1"];
    let report = json(&[&run[..], &small, &["--gpu-fallback"]].concat());
    assert_eq!(
        (&report["backend"], &report["backend_used"]),
        (&"gpu".into(), &"cpu".into())
    );
    for place in ["backend_reason", "warnings"] {
        assert!(report[place].to_string().contains("feature gpu"), "{place}");
    }
    let plain = json(&[&run[..], &["--faces", "80"]].concat());
    assert_eq!(plain["final_q"], report["final_q"]);
}

#[test]
fn the_backend_is_in_every_summary() {
    let ball = scene("falling_ball");
    let report = json(&["run", &ball, "--faces", "80", "--steps", "1"]);
    assert_eq!(
        (&report["backend"], &report["backend_used"]),
        (&"cpu".into(), &"cpu".into())
    );
    assert!(report["device"].is_null() && report["backend_reason"].is_null());
    let plain = hydrograd(&["added-mass", "--shape", "sphere:1", "--faces", "80"]);
    assert!(text(&plain.stdout).contains("backend cpu"));
    // A GPU's settings without the GPU.
    let unused = ["--adapter", "llvmpipe", "--faces", "80", "--steps", "1"];
    let report = json(&[&["run", &ball][..], &unused].concat());
    assert!(report["warnings"].to_string().contains("no effect"));
    fails(
        &["run", &ball, "--adapter", ""],
        2,
        &["part of the adapter's name"],
    );
    fails(
        &["run", &ball, "--backend", "gup"],
        2,
        &["gup", "cpu", "gpu"],
    );
}

#[test]
fn a_run_says_what_auto_chose() {
    let scene = scene("falling_ball");
    let arguments = ["run", &scene, "--steps", "1", "--fidelity", "auto"];
    let report = json(&arguments);
    assert_eq!(
        (&report["fidelity"], &report["fidelity_used"]),
        (&"auto".into(), &"reduced".into())
    );
    assert!(report["chosen"].as_array().unwrap().len() >= 2);
    crate::support::says(
        said(&arguments),
        &["auto: reduced", "chosen  body \"coin\" resolves gaps"],
    );
}

/// Under a limit of its memory the program does what it was asked or says what doesn't fit: it isn't ended by the system.
#[cfg(target_os = "linux")]
#[test]
fn ceilings_of_memory_are_respected() {
    let coins = crate::support::command::scene("coins");
    let ball = crate::support::command::scene("falling_ball");
    let commands = [
        "added-mass --shape box:1,1,0.5 --faces 5000".to_string(),
        "added-mass --shape cylinder:1,1 --faces 4000 --method mfs-vertex".into(),
        format!("added-mass {coins} --fidelity full --faces 2000"),
        format!("run {ball} --fidelity reduced --faces 1280 --steps 3"),
        format!("run {coins} --steps 100000000"),
    ];
    let (mut done, mut refused) = (0, 0);
    for megabytes in [300, 400, 600, 1000] {
        for command in &commands {
            let program = env!("CARGO_BIN_EXE_hydrograd");
            let limited = format!("ulimit -v {}; exec {program} {command}", 1000 * megabytes);
            let out = std::process::Command::new("sh")
                .args(["-c", &limited])
                .output()
                .unwrap();
            let said = text(&out.stderr);
            match out.status.code() {
                Some(0) => done += 1,
                Some(1) => {
                    crate::support::says(&said, &["hydrograd: "]);
                    assert!(
                        ["bytes of memory", "run in parts"]
                            .iter()
                            .any(|s| said.contains(s)),
                        "{said}"
                    );
                    refused += 1;
                }
                code => panic!("{megabytes} MB: {command}: {code:?}: {said}"),
            }
        }
    }
    assert!(done >= 6 && refused >= 10, "{done} done, {refused} refused");
}

/// What can't be printed is no success.
#[cfg(target_os = "linux")]
#[test]
fn a_result_that_is_lost_is_a_failure() {
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let arguments = ["added-mass", "--shape", "sphere:0.1", "--faces", "80"];
    let mut command = crate::support::command::command(&arguments);
    let done = command.stdout(full).output().unwrap();
    assert_eq!(done.status.code(), Some(1));
    assert!(text(&done.stderr).contains("standard output"));
}

/// Of a scene `inspect` tells what its robots come to, in that scene's water; a run warns of what of them is dry.
#[cfg(feature = "urdf")]
#[test]
fn robots_of_scenes_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let inertial = r#"<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"#;
    let ball = |name: &str, radius: f64| {
        format!(
            r#"<link name="{name}">{inertial}<collision><geometry><sphere radius="{radius}"/></geometry></collision></link>"#
        )
    };
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            r#"<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/></joint>"#
        )
    };
    let whole = [
        ball("a", 0.2),
        format!(r#"<link name="b">{inertial}</link>"#),
        ball("c", 0.03),
        joint("j", "a", "b"),
        joint("k", "b", "c"),
    ];
    let text = format!("<robot name=\"r\">{}</robot>", whole.concat());
    let robot = file(&folder, "robot.urdf", &text);
    let scene = "time_step = 0.01\nsteps = 1\n[fluid]\ndensity = 500.0\n";
    let empty = file(&folder, "empty.toml", scene);
    let two = "[[robot]]\nurdf = \"robot.urdf\"\n[[robot]]\nurdf = \"robot.urdf\"\nprefix = \"o/\"\nposition = [9.0, 0.0, 0.0]\n";
    let two = file(&folder, "two.toml", &format!("{scene}{two}"));
    let told = json(&["inspect", &two]);
    assert_eq!(told["robots"].as_array().unwrap().len(), 2);
    assert_eq!(told["robots"][1]["density"], 500.0);
    let people = said(&["inspect", &two]);
    assert_eq!(people.matches("robot \"r\"").count(), 2, "{people}");
    fails(&["inspect", &empty], 1, &["empty.toml", "no robot"]);
    fails(
        &["inspect", &two, "--density", "1"],
        1,
        &["--density", "fluid"],
    );
    fails(
        &["inspect", &two, "--faces", "80"],
        1,
        &["--faces", "[[robot]]"],
    );
    fails(
        &["run", &robot, "--density=-1"],
        1,
        &["fluid.density", "-1"],
    );
    // In no water there is nothing that flows, and nothing floats.
    let moved = |density: &str| {
        let ran = json(&[
            "run",
            &robot,
            "--steps",
            "1",
            "--fidelity",
            "isolated",
            "--density",
            density,
        ]);
        ran["energy_final"].as_f64().unwrap()
    };
    assert_ne!(moved("998"), moved("0"));
    for input in [&two, &robot] {
        let ran = said(&["run", input, "--steps", "1", "--fidelity", "isolated"]);
        crate::support::says(&ran, &["warning: robot \"r\"", "body \"c\" is dry"]);
    }
}
