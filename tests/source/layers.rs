//! What may import what: the crate's layers, held against its `use` lines and paths.

use super::graph::{code, sources, split_group};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Modules that each module may name, each of which stands above it. `error` is free for all, and so is the crate's root for
/// `Error` and `Result` alone.
///
/// `adjoint::lie` gives vectors and poses to everyone; the modules marked `adjoint` use the ladder too.
const LAYERS: [(&str, &[&str]); 25] = [
    ("error", &[]),
    // What enums that users choose from can do.
    ("choices", &[]),
    ("special", &[]),
    // What is made when it is first asked for.
    ("once", &[]),
    // What computations may take.
    ("memory", &[]),
    // Closed meshes and walls, and what is asked of them.
    ("geometry", &["adjoint"]),
    ("shape", &["adjoint", "geometry", "special"]),
    ("multibody", &["adjoint"]),
    // Robots from files.
    ("robot", &["adjoint", "geometry", "multibody", "shape"]),
    ("scene", &["geometry", "multibody", "robot", "shape"]),
    ("solver", &["adjoint"]),
    (
        "boundary",
        &["adjoint", "geometry", "memory", "once", "solver", "special"],
    ),
    (
        "coupling",
        &[
            "adjoint", "boundary", "geometry", "memory", "once", "solver",
        ],
    ),
    (
        "gpu",
        &["adjoint", "boundary", "coupling", "geometry", "solver"],
    ),
    ("contact", &["adjoint", "geometry", "shape"]),
    (
        "dynamics",
        &[
            "adjoint",
            "contact",
            "coupling",
            "multibody",
            "once",
            "scene",
            "solver",
        ],
    ),
    // Controllers: what acts, from what is observed.
    ("policy", &[]),
    // How the bodies feel each other: methods, fidelities, device, gaps.
    (
        "water",
        &[
            "adjoint",
            "boundary",
            "coupling",
            "gpu",
            "geometry",
            "multibody",
            "scene",
            "shape",
        ],
    ),
    // From a scene to a system.
    (
        "assembly",
        &[
            "adjoint",
            "contact",
            "coupling",
            "dynamics",
            "geometry",
            "memory",
            "multibody",
            "policy",
            "scene",
            "shape",
            "water",
        ],
    ),
    // What runs.
    (
        "simulate",
        &[
            "adjoint",
            "assembly",
            "boundary",
            "contact",
            "coupling",
            "dynamics",
            "gpu",
            "geometry",
            "memory",
            "multibody",
            "once",
            "policy",
            "scene",
            "shape",
            "water",
        ],
    ),
    (
        "tradeoff",
        &[
            "adjoint", "geometry", "boundary", "coupling", "dynamics", "scene", "shape", "simulate",
        ],
    ),
    // Descent stands on what a user sees: parameters are what is identified.
    ("optimize", &["adjoint", "dynamics", "simulate"]),
    // Runs as files of other programs.
    ("output", &["adjoint", "geometry", "memory", "simulate"]),
    // The facade names what it shows; the command line stands on the facade.
    (
        "lib",
        &["adjoint", "geometry", "scene", "shape", "simulate"],
    ),
    (
        "cli",
        &[
            "boundary", "coupling", "dynamics", "geometry", "gpu", "output", "scene", "shape",
            "simulate", "tradeoff", "water",
        ],
    ),
];

/// Modules of which only the named parts may be used.
const ONLY: [(&str, &str, &[&str]); 7] = [
    ("shape", "adjoint", &["lie"]),
    ("contact", "adjoint", &["lie"]),
    ("multibody", "adjoint", &["lie"]),
    ("robot", "adjoint", &["lie"]),
    ("output", "adjoint", &["lie"]),
    ("optimize", "adjoint", &["lie", "sample"]),
    ("optimize", "dynamics", &["Drive", "Parameters"]),
];

/// Paths `from::a::b` in the text, as the segments after `from`; a group `from::{a::c, b}` gives one
/// for each member.
fn paths(text: &str, from: &str) -> Vec<Vec<String>> {
    let start = format!("{from}::");
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = Vec::new();
    for (at, _) in text.match_indices(&start) {
        if text[..at].chars().next_back().is_some_and(word) {
            continue;
        }
        let rest = &text[at + start.len()..];
        let members: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => split_group(group),
            None => vec![rest],
        };
        for member in members {
            let end = member.find(|c: char| !word(c) && c != ':');
            let path = member[..end.unwrap_or(member.len())].trim_end_matches(':');
            let segments = path.split("::").map(str::to_string);
            out.push(segments.collect());
        }
    }
    out
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn every_module_names_only_what_its_layer_may() {
    let allowed: BTreeMap<_, _> = LAYERS.iter().copied().collect();
    let mut wrong = Vec::new();
    let mut seen = BTreeSet::new();
    for path in sources(&root().join("src")) {
        let inside = path.strip_prefix(root().join("src")).unwrap();
        let first = inside.iter().next().unwrap().to_str().unwrap();
        let module = first.trim_end_matches(".rs");
        if module == "bin" || module == "notation" {
            continue;
        }
        seen.insert(module.to_string());
        let Some(may) = allowed.get(module) else {
            wrong.push(format!("{}: layer not in the table", inside.display()));
            continue;
        };
        let text = code(&path);
        let own = paths(&text, "crate").into_iter();
        let lower = paths(&text, "hydrograd_adjoint").into_iter().map(|mut p| {
            p.insert(0, "adjoint".into());
            p
        });
        for used in own.chain(lower) {
            let name = used[0].as_str();
            if name == module || ["error", "Error", "Result"].contains(&name) {
                continue;
            }
            let partly = ONLY.iter().find(|(m, u, _)| (*m, *u) == (module, name));
            let narrow = partly.is_none_or(|(_, _, parts)| {
                used.get(1).is_some_and(|u| parts.contains(&u.as_str()))
            });
            if !may.contains(&name) || !narrow {
                wrong.push(format!("{}: {}", inside.display(), used.join("::")));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "against the layers:\n{}",
        wrong.join("\n")
    );
    for (module, _) in LAYERS {
        assert!(
            seen.contains(module),
            "{module} is in the table but not in src"
        );
    }
}

#[test]
fn layers_are_ordered() {
    let mut above = BTreeSet::from(["adjoint"]);
    for (module, may) in LAYERS {
        for used in may {
            assert!(above.contains(used), "{module} may name {used} below it");
        }
        assert!(above.insert(module), "{module} stands twice");
    }
}

#[test]
fn kernels_know_nothing_of_the_simulator() {
    for path in sources(&root().join("adjoint/src")) {
        let found = paths(&code(&path), "hydrograd");
        assert!(found.is_empty(), "{}: {found:?}", path.display());
    }
    let manifest = std::fs::read_to_string(root().join("adjoint/Cargo.toml")).unwrap();
    let depends = manifest.lines().any(|l| l.starts_with("hydrograd "));
    assert!(!depends, "hydrograd-adjoint depends on hydrograd");
}

/// After faer's own products functions such as `exp` are slow: src/solver/matmul.rs gives the registers back.
#[test]
fn products_of_matrices_go_by_the_solvers() {
    let named = |path: &PathBuf| code(path).contains("linalg::matmul");
    let found: Vec<PathBuf> = sources(&root().join("src"))
        .into_iter()
        .filter(named)
        .collect();
    assert_eq!(found, [root().join("src/solver/matmul.rs")]);
}

#[test]
fn paths_are_found_in_lines_and_groups() {
    let found = paths(
        "use crate::{Error, shape::{self, a}, b::c}; my_crate::d; crate::e::f::<G>();",
        "crate",
    );
    let joined: Vec<String> = found.iter().map(|p| p.join("::")).collect();
    assert_eq!(joined, ["Error", "shape", "b::c", "e::f"]);
}
