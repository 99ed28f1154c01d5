//! Added masses in the formats of other simulators, read back.

use crate::support::command::{hydrograd, text};
use crate::support::says;
use hydrograd::adjoint::lie::Mat6;
use hydrograd::{Fidelity, Scene, Settings, Simulator};

/// Two bodies that are turned, one of them off its origin; `turned` false: as they lie in their own axes.
fn scene(turned: bool) -> String {
    let [one, two] = match turned {
        true => ["[0.4, -0.7, 1.1]", "[-1.0, 0.3, 0.2]"],
        false => ["[0.0, 0.0, 0.0]"; 2],
    };
    format!(
        "name = \"two\"\ntime_step = 0.01\nsteps = 1\n[fluid]\ndensity = 1025.0\n\
         [[bodies]]\nname = \"hull <1>\"\nshape = {{ kind = \"ellipsoid\", semi_axes = [0.5, 0.2, 0.1] }}\n\
         shape_at = {{ position = [0.1, 0.05, -0.02], rotation = [0.1, 0.2, 0.3] }}\ndensity = 1000.0\n\
         placement = {{ position = [1.0, 2.0, 3.0], rotation = {one} }}\njoint = {{ kind = \"free\" }}\n\
         [[bodies]]\nname = \"fin\"\nshape = {{ kind = \"ellipsoid\", semi_axes = [0.1, 0.2, 0.02] }}\ndensity = 1000.0\n\
         placement = {{ position = [9.0, 2.0, 3.0], rotation = {two} }}\njoint = {{ kind = \"free\" }}\n"
    )
}

/// The blocks of the bodies as they lie in their own axes.
fn expected() -> [Mat6; 2] {
    let scene = Scene::from_toml(&scene(false), ".").unwrap();
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let found = Simulator::new(&scene, settings)
        .unwrap()
        .added_mass()
        .unwrap();
    [0, 6].map(|k| found.matrix.fixed_view::<6, 6>(k, k).into_owned())
}

fn close(found: &Mat6, exact: &Mat6, tolerance: f64) {
    let error = (found - exact).amax() / exact.amax();
    assert!(error < tolerance, "{error:.1e}: {found} for {exact}");
}

fn written(format: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.toml");
    std::fs::write(&path, scene(true)).unwrap();
    let path = path.display().to_string();
    text(&[
        "added-mass",
        &path,
        "--fidelity",
        "isolated",
        "--format",
        format,
    ])
}

#[test]
fn sdf_holds_each_links_matrix_in_its_own_frame() {
    let out = written("sdf");
    let links: Vec<&str> = out.split("<link name=").skip(1).collect();
    assert!(links[0].starts_with("\"hull &lt;1&gt;\""), "{out}");
    for (link, exact) in links.iter().zip(expected()) {
        let inside = link.split("<fluid_added_mass>").nth(1).unwrap();
        let axes = ["x", "y", "z", "p", "q", "r"];
        let mut found = Mat6::zeros();
        for i in 0..6 {
            for j in i..6 {
                let tag = format!("<{}{}>", axes[i], axes[j]);
                let value = inside.split(&tag).nth(1).unwrap();
                let value: f64 = value.split('<').next().unwrap().parse().unwrap();
                (found[(i, j)], found[(j, i)]) = (value, value);
            }
        }
        close(&found, &exact, 1e-8);
        assert!(found.symmetric_eigenvalues().min() > 0.0);
    }
}

#[test]
fn fossens_derivatives_are_the_matrix_with_the_sign_turned() {
    let out = written("fossen");
    for (body, exact) in out.split("M_A = [").skip(1).zip(expected()) {
        let (matrix, rest) = body.split_once(']').unwrap();
        let numbers: Vec<f64> = matrix
            .split_whitespace()
            .map(|x| x.parse().unwrap())
            .collect();
        close(&Mat6::from_row_slice(&numbers), &exact, 1e-8);
        let value = |name: &str| -> f64 {
            let line = rest.lines().find_map(|l| l.strip_prefix(name)).unwrap();
            line.trim_start_matches(" = ").parse().unwrap()
        };
        for (name, at) in [("X_udot", (0, 0)), ("Y_rdot", (1, 5)), ("N_rdot", (5, 5))] {
            assert!((value(name) + exact[at]).abs() < 1e-8 * exact.amax());
        }
    }
}

#[test]
fn tables_and_objects_hold_all_digits() {
    let out = written("csv");
    let rows: Vec<Vec<f64>> = (out.lines().skip(1))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            cells[2..].iter().map(|x| x.parse().unwrap()).collect()
        })
        .collect();
    for (k, exact) in expected().iter().enumerate() {
        let found = Mat6::from_fn(|i, j| rows[6 * k + i][j]);
        close(&found, exact, 1e-12);
    }
    let value: serde_json::Value = serde_json::from_str(&written("json")).unwrap();
    assert_eq!(value["density"].as_f64(), Some(1025.0));
    let fin = &value["added_mass"]["fin"];
    let found = Mat6::from_fn(|i, j| fin[i][j].as_f64().unwrap());
    close(&found, &expected()[1], 1e-12);
}

/// Standard output holds one JSON object where that is asked for, and a format is none: refused on either side of the command.
#[test]
fn no_format_beside_json() {
    let asked = ["added-mass", "--shape", "sphere:1", "--format", "fossen"];
    for arguments in [
        [&["--json"][..], &asked].concat(),
        [&asked[..], &["--json"]].concat(),
    ] {
        let done = hydrograd(&arguments);
        assert_eq!(done.status.code(), Some(2), "{arguments:?}");
        let value: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        for message in [said.as_str(), value["error"].as_str().unwrap()] {
            says(message, &["--format", "--json"]);
        }
    }
}
