//! `hydrograd tradeoff`.

use crate::support::command::{self, hydrograd, scene};
use crate::support::says;
use serde_json::Value;

fn json(arguments: &[&str]) -> Value {
    command::json(&[&["tradeoff"], arguments].concat())
}

/// Fails with this code and these words, for people and for programs.
fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    command::fails(&[&["tradeoff"], arguments].concat(), code, words);
}

/// A row's entry that must be a number above zero.
fn number(row: &Value, key: &str) -> f64 {
    let x = row[key].as_f64();
    let x = x.unwrap_or_else(|| panic!("{key} is {}: {row}", row[key]));
    assert!(x > 0.0 && x.is_finite(), "{key} is {x}");
    x
}

const NUMBERS: [&str; 14] = [
    "faces",
    "unknowns",
    "rank",
    "points",
    "accuracy",
    "tolerance",
    "ms_per_step",
    "ms_per_gradient_step",
    "ms_per_simulated_second",
    "added_mass_rel_error",
    "acceleration_rel_error",
    "end_state_rel_error",
    "setup_seconds",
    "timed_steps",
];

/// Rows of this fidelity and method.
fn rows<'a>(report: &'a Value, fidelity: &str, method: &str) -> Vec<&'a Value> {
    let all = report["rows"].as_array().unwrap().iter();
    all.filter(|r| r["fidelity"] == fidelity && r["method"] == method)
        .collect()
}

/// Opening and closing tags match.
fn is_svg(text: &str) {
    assert!(text.trim_start().starts_with("<svg") && text.trim_end().ends_with("</svg>"));
    let mut open: Vec<&str> = Vec::new();
    for piece in text.split('<').skip(1) {
        let (tag, _) = piece.split_once('>').expect("a tag that ends");
        let word = tag.trim_start_matches('/').split([' ', '\n', '/']).next();
        let word = word.unwrap();
        match (tag.starts_with('/'), tag.ends_with('/')) {
            (true, _) => assert_eq!(open.pop(), Some(word)),
            (false, true) => {}
            (false, false) => open.push(word),
        }
    }
    assert!(open.is_empty(), "{open:?} stay open");
}

#[test]
fn two_spheres_compared() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("new/two.svg").display().to_string();
    let report = json(&[
        &scene("two_spheres"),
        "--fidelities",
        "isolated,reduced,auto,full",
        "--methods",
        "panel,exact",
        "--faces-list",
        "80",
        "--ranks",
        "10,40",
        "--accuracies",
        "1e-2",
        "--tolerances",
        "1e-6",
        "--integrators",
        "rk2,momentum-euler",
        "--time-steps",
        "0.01,0.02",
        "--steps",
        "8",
        "--reference-faces",
        "500",
        "--budget",
        "30",
        "--plot",
        &picture,
    ]);
    assert_eq!(report["scene"], "two spheres");
    assert_eq!(report["files"][0].as_str().unwrap(), picture);
    assert_eq!(report["left_out"], Value::Array(Vec::new()));
    number(&report, "seconds");
    number(&report, "threads");
    let reference = &report["reference"];
    for part in ["added_mass", "acceleration", "end_state"] {
        assert!(!reference[part]["what"].as_str().unwrap().is_empty());
        let estimate = number(&reference[part], "error_estimate");
        assert!(estimate < 0.05, "{part} ±{estimate}");
    }
    // Two methods of their own: they must agree about as well as they say.
    let bound = number(&reference["added_mass"], "error_estimate") + 1e-4;
    assert!(number(reference, "moving_differs_by") < 3.0 * bound);

    let all = report["rows"].as_array().unwrap();
    for row in all {
        for key in NUMBERS {
            let value = row.get(key).unwrap_or_else(|| panic!("no {key}"));
            assert!(value.is_null() || value.as_f64().unwrap().is_finite());
        }
        for key in [
            "family",
            "fidelity",
            "fidelity_used",
            "method",
            "integrator",
        ] {
            assert!(!row[key].as_str().unwrap().is_empty());
        }
        for key in ["below_reference", "pareto", "pareto_end_state"] {
            assert!(row[key].is_boolean());
        }
        number(row, "time_step");
        if row["error"].is_null() {
            let step = number(row, "ms_per_step");
            assert!(number(row, "ms_per_gradient_step") > step);
            assert!(
                (number(row, "ms_per_simulated_second") * number(row, "time_step") / step - 1.0)
                    .abs()
                    < 1e-9
            );
            number(row, "added_mass_rel_error");
            number(row, "acceleration_rel_error");
            number(row, "end_state_rel_error");
        }
    }
    // One by one: fidelities, their other method, and what each has of its own.
    let find = |fidelity, method| rows(&report, fidelity, method);
    assert_eq!(find("isolated", "panel").len(), 1);
    assert_eq!(find("isolated", "exact").len(), 1);
    assert_eq!(find("reduced", "exact").len(), 1);
    // Base, two ranks, an integrator, a time step.
    assert_eq!(find("reduced", "panel").len(), 5);
    let error = |row: &Value| number(row, "added_mass_rel_error");
    assert!(error(find("isolated", "exact")[0]) > 0.05);
    assert!(error(find("reduced", "exact")[0]) < 0.01);
    let panel = find("reduced", "panel");
    let rank = |n: u64| panel.iter().find(|r| r["rank"] == n).unwrap();
    assert!(error(rank(10)) > error(rank(40)));
    assert!(panel.iter().any(|r| r["integrator"] == "momentum-euler"));
    assert!(panel.iter().any(|r| r["time_step"] == 0.02));
    // What can't run is a row that says so, with what could be had.
    let panels = find("full", "panel");
    assert!(panels[0]["error"].is_null());
    // What meshes of 80 faces lack in the coupling, extrapolated as the spheres themselves are.
    assert!((0.003..0.01).contains(&error(panels[0])));
    assert!(number(panels[0], "ms_per_step") > 0.0);
    let impossible = find("full", "exact");
    assert!(
        impossible[0]["error"]
            .as_str()
            .unwrap()
            .contains("single bodies")
    );
    assert!(impossible[0]["added_mass_rel_error"].is_null());
    assert_eq!(panels[0]["tolerance"], 1e-6);

    fronts_are_right(&report);
    let text = std::fs::read_to_string(&picture).unwrap();
    is_svg(&text);
    for word in [
        "time per step, ms",
        "relative error of the added mass",
        "reduced, panel",
    ] {
        assert!(text.contains(word), "no {word:?} in the picture");
    }
}

/// Both marks against their definitions.
fn fronts_are_right(report: &Value) {
    let all = report["rows"].as_array().unwrap();
    let fronts = [
        (
            "pareto",
            "ms_per_step",
            "added_mass_rel_error",
            "added_mass",
        ),
        (
            "pareto_end_state",
            "ms_per_simulated_second",
            "end_state_rel_error",
            "end_state",
        ),
    ];
    for (mark, time, error, part) in fronts {
        let floor = report["reference"][part]["error_estimate"]
            .as_f64()
            .unwrap_or(0.0);
        let alike = |r: &Value| {
            let same = |key: &str| r[key] == all[0][key];
            part == "end_state" || (same("integrator") && same("time_step"))
        };
        let points: Vec<Option<(f64, f64)>> = all
            .iter()
            .map(|r| Some((r[time].as_f64()?, r[error].as_f64()?.max(floor))).filter(|_| alike(r)))
            .collect();
        for (row, point) in all.iter().zip(&points) {
            let expected = point.is_some_and(|(t, e)| {
                let others = points.iter().flatten();
                !others
                    .clone()
                    .any(|(u, f)| *u <= t && *f <= e && (*u < t || *f < e))
            });
            assert_eq!(row[mark], expected, "{mark} of {row}");
        }
        assert!(all.iter().any(|r| r[mark] == true), "nobody has {mark}");
    }
}

#[test]
fn what_no_fidelity_takes_is_refused() {
    let words = ["tolerances", "reduced", "full"];
    let cube = scene("cube");
    let given = [&cube[..], "--fidelities", "reduced", "--tolerances", "1e-3"];
    fails(&given, 1, &words);
    let given = [&cube[..], "--fidelities", "full", "--ranks", "20"];
    fails(&given, 1, &["ranks", "full", "reduced"]);
}

#[test]
fn what_the_budget_has_no_time_for_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("nothing.svg");
    let arguments = [
        "tradeoff",
        &scene("cube"),
        "--faces-list",
        "48",
        "--steps",
        "4",
        "--reference-faces",
        "192",
        "--budget",
        "0.01",
        "--plot",
        &picture.display().to_string(),
    ];
    let plain = hydrograd(&arguments);
    let text = String::from_utf8_lossy(&plain.stdout).into_owned();
    assert!(text.contains("left out for the budget of 0.01 s"), "{text}");
    assert!(text.contains("ms/step") && text.contains("M_f"), "{text}");
    let json = hydrograd(&[&arguments[..], &["--json"]].concat());
    let report: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert!(!report["left_out"].as_array().unwrap().is_empty());
    assert_eq!(report["rows"], Value::Array(Vec::new()));
    // Nothing was measured: that is no success, and no picture.
    assert!(!picture.exists());
    assert_eq!(report["files"], Value::Array(Vec::new()));
    for done in [plain, json] {
        assert_eq!(done.status.code(), Some(1));
        let said = String::from_utf8(done.stderr).unwrap();
        says(
            said,
            &["no configuration was measured", "0.01 s", "--budget"],
        );
    }
}

const STILL: &str = r#"
time_step = 0.01
steps = 4
[fluid]
density = 998.0
[[bodies]]
name = "ball"
shape = { kind = "sphere", radius = 0.05, faces = 80 }
mass = 2.0
"#;

/// At rest in still water nothing accelerates: a force is made up, and end states don't exist. The budget may be longer than clocks count.
#[test]
fn a_scene_at_rest_is_compared_by_its_accelerations() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("still.toml");
    std::fs::write(&file, STILL).unwrap();
    let file = file.display().to_string();
    let report = json(&[
        &file,
        "--fidelities",
        "isolated",
        "--methods",
        "exact,mfs-vertex",
        "--faces-list",
        "80",
        "--reference-faces",
        "500",
        "--integrators",
        "rk2",
        "--time-steps",
        "0.01",
        "--budget",
        "1e30",
    ]);
    assert_eq!(report["budget"], 1e30);
    let said = &report["reference"]["acceleration"]["what"];
    assert!(said.as_str().unwrap().contains("pseudo-random force"));
    assert!(report["reference"]["end_state"].is_null());
    assert!(
        report["reference"]["notes"]
            .to_string()
            .contains("nothing moves")
    );
    let error = |method| {
        let row = rows(&report, "isolated", method)[0];
        assert!(row["end_state_rel_error"].is_null() && row["pareto_end_state"] == false);
        row["acceleration_rel_error"].as_f64().unwrap()
    };
    assert!(error("exact") < 1e-6, "{}", error("exact"));
    assert!(
        (1e-3..0.2).contains(&error("mfs-vertex")),
        "{}",
        error("mfs-vertex")
    );
}

/// A picture that can't be written costs neither the measurements nor the one that was there.
#[cfg(unix)]
#[test]
fn a_picture_that_is_lost_leaves_the_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let (file, picture) = (
        folder.path().join("still.toml"),
        folder.path().join("still.svg"),
    );
    std::fs::write(&file, STILL).unwrap();
    std::fs::write(&picture, "old").unwrap();
    // No file may grow past a block of 512 bytes: writing fails as on a full disk.
    let script = "trap '' XFSZ; ulimit -f 1; exec \"$@\"";
    let done = std::process::Command::new("sh")
        .args(["-c", script, "sh", env!("CARGO_BIN_EXE_hydrograd")])
        .args(["tradeoff", &file.display().to_string(), "--json"])
        .args(["--plot", &picture.display().to_string()])
        .args(["--fidelities", "isolated", "--methods", "exact"])
        .args(["--faces-list", "80", "--reference-faces", "320"])
        .args(["--integrators", "rk2", "--time-steps", "0.01"])
        .output()
        .unwrap();
    let said = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1), "{said}");
    says(&said, &["still.svg", "write failed"]);
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["files"], Value::Array(Vec::new()));
    let row = rows(&report, "isolated", "exact")[0];
    number(row, "added_mass_rel_error");
    assert_eq!(std::fs::read_to_string(&picture).unwrap(), "old");
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 2, "no temporary files stay behind");
}

#[test]
fn wrong_usage_is_told() {
    let two = scene("two_spheres");
    fails(&["nowhere.toml"], 1, &["nowhere.toml", "no such file"]);
    fails(&[], 2, &["SCENE.toml"]);
    fails(
        &[&two, "--fidelities", "reduced,fulll"],
        2,
        &["fulll", "full"],
    );
    fails(&[&two, "--ranks", "20,0"], 2, &["above zero"]);
    fails(&[&two, "--accuracies", "2"], 2, &["between 0 and 1"]);
    fails(&[&two, "--time-steps", "-0.1"], 2, &["above zero, in s"]);
    fails(&[&two, "--budget", "0"], 2, &["above zero, in s"]);
    fails(&[&two, "--steps", "0"], 2, &["above zero"]);
    fails(&[&two, "--plot", "two.png"], 1, &["two.png", ".svg"]);
    // The folder is tried before anything is measured.
    #[cfg(target_os = "linux")]
    fails(
        &[&two, "--plot", "/proc/two.svg"],
        1,
        &["/proc: write failed"],
    );
    let folder = tempfile::tempdir().unwrap();
    let changed = |name: &str, from: &str, to: &str| {
        let file = folder.path().join(name);
        assert!(STILL.contains(from));
        std::fs::write(&file, STILL.replace(from, to)).unwrap();
        file.display().to_string()
    };
    let dry = changed("dry.toml", "density = 998.0", "density = 0.0");
    fails(&[&dry], 1, &["fluid.density", "without water"]);
    let locked = changed("locked.toml", "mass = 2.0", "mass = 2.0\nlocked = true");
    fails(&[&locked], 1, &["joints that forces move"]);
    let help = hydrograd(&["tradeoff", "--help"]);
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    for flag in [
        "--fidelities",
        "--faces-list",
        "--full-product",
        "--budget",
        "--plot",
        "[default",
    ] {
        assert!(help.contains(flag), "no {flag} in {help}");
    }
}
