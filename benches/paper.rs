//! The paper's table of costs again: its own choices beside this program's defaults.
//!
//! `cargo bench --bench paper [-- SCENE …] [--quick]`. For each scene `preset = "paper"` (velocity form, fundamental
//! solutions a face, Eq. 20; here in double precision) and the defaults of `full` (also by fundamental solutions), `reduced` and `auto`, each in a process of
//! its own: seconds a step, seconds a step with its gradient, peak memory, and the error of M_f at the start in generalised
//! coordinates, max |ΔM_ij| / √(M_ii M_jj). The reference is `full` by panels on finer meshes; `--quick`
//! takes coarser ones and, unless scenes are
//! named, the first two scenes.

#[allow(dead_code)]
mod common;

use common::reference::{Reference, reference};
use common::support::scaled_error;
use common::{Effort, arguments, in_child, scene, serve_child};
use nalgebra::DMatrix;

/// A scene of the paper's table.
struct Row {
    scene: &'static str,
    /// Seconds a frame on an RTX 3060 with an i7-11800H, single precision, as published.
    published: Option<f64>,
}

const ROWS: [Row; 5] = [
    Row {
        scene: "falling_ball_box",
        published: Some(0.310),
    },
    Row {
        scene: "falling_ball",
        published: None,
    },
    Row {
        scene: "grasp_open",
        published: Some(0.413),
    },
    Row {
        scene: "fish_near_tail",
        published: Some(0.819),
    },
    Row {
        scene: "clown_fish",
        published: Some(0.940),
    },
];

/// Faces of the reference's two resolutions relative to the scene's.
const MESHES: [f64; 2] = [1.0, 2.25];
const QUICK_MESHES: [f64; 2] = [0.25, 0.5625];

fn main() {
    if serve_child() {
        return;
    }
    let arguments = arguments();
    let quick = arguments.iter().any(|a| a == "--quick");
    let chosen: Vec<&String> = arguments.iter().filter(|a| !a.starts_with("--")).collect();
    println!(
        "| scene | configuration | faces | unknowns | s/step | s/step with gradient | ratio | peak MB | error of M_f | paper, s/step |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut notes = Vec::new();
    let most = if quick && chosen.is_empty() {
        2
    } else {
        ROWS.len()
    };
    for row in &ROWS[..most] {
        if !chosen.is_empty() && !chosen.iter().any(|c| *c == row.scene) {
            continue;
        }
        let Some(scene) = scene(row.scene) else {
            continue;
        };
        let meshes = if quick { QUICK_MESHES } else { MESHES };
        let reference = reference(&scene, meshes);
        notes.push(match &reference {
            Ok(r) => format!(
                "{}: reference of {} faces, {:.1e} from that of fewer",
                scene.name, r.faces, r.rest
            ),
            Err(e) => format!("{}: no reference ({e})", scene.name),
        });
        let mut name = scene.name.as_str();
        let mut published = row.published.map_or("–".into(), |s| format!("{s:.3}"));
        for configuration in ["paper", "full mfs-vertex", "full", "reduced", "auto"] {
            print_row(
                (name, row.scene, configuration),
                reference.as_ref().ok(),
                &published,
                effort(configuration, quick),
            );
            (name, published) = ("", String::new());
        }
    }
    println!();
    notes.iter().for_each(|n| println!("- {n}"));
}

fn effort(configuration: &str, quick: bool) -> Effort {
    let compressed = matches!(configuration, "reduced" | "auto");
    let (steps, repeat) = match (compressed, quick) {
        (true, false) => (50, 5),
        (true, true) => (5, 1),
        (false, false) => (3, 3),
        (false, true) => (1, 1),
    };
    Effort { steps, repeat }
}

fn print_row(
    (name, file, configuration): (&str, &str, &str),
    reference: Option<&Reference>,
    published: &str,
    effort: Effort,
) {
    let run = match in_child(file, configuration, effort, None) {
        Ok(run) => run,
        Err(e) => {
            println!("| {name} | {configuration} | {e} ||||||| {published} |");
            return;
        }
    };
    let label = match configuration {
        "paper" => "`preset = \"paper\"`".to_string(),
        "auto" => format!("`auto` ({})", run.fidelity),
        other => format!("`{other}`"),
    };
    let error = reference.map_or("–".to_string(), |r| {
        let n = r.matrix.nrows();
        let found = DMatrix::from_column_slice(n, n, &run.added_mass);
        format!("{:.1e}", scaled_error(&found, &r.matrix))
    });
    println!(
        "| {name} | {label} | {} | {} | {:.2e} | {:.2e} | {:.2} | {:.0} | {error} | {published} |",
        run.faces,
        run.unknowns,
        run.forward,
        run.gradient,
        run.gradient / run.forward,
        run.memory,
    );
}
