//! No import circles: in no folder do files and folders beside each other reach each other by imports.
//!
//! A folder's `mod.rs` is the whole of which the others are parts: it may use them, and they what it defines. In the
//! folders of [`STRICT`] not even that.

use super::graph::{Crate, circles};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Circles of every folder: the folder, and what it says of each.
fn found(source: &str) -> Vec<(PathBuf, String)> {
    let all = Crate::read(&root().join(source));
    let imports = all.imports();
    // By folder: entries, their imports among each other, and an example of each.
    type Graph = (
        BTreeMap<PathBuf, BTreeSet<PathBuf>>,
        BTreeMap<(PathBuf, PathBuf), String>,
    );
    let mut folders: BTreeMap<PathBuf, Graph> = BTreeMap::new();
    for (from, targets) in &imports {
        for (to, path) in targets {
            let common: PathBuf = from
                .iter()
                .zip(to.iter())
                .take_while(|(a, b)| a == b)
                .map(|(a, _)| a)
                .collect();
            let depth = common.iter().count();
            let entry = |file: &Path| -> PathBuf { file.iter().take(depth + 1).collect() };
            let strict = STRICT
                .iter()
                .any(|s| Path::new(source).join(&common).starts_with(s));
            if !strict
                && from.file_name().is_some_and(|n| n == "mod.rs")
                && from.parent() == Some(&common)
            {
                continue;
            }
            let graph = folders.entry(common.clone()).or_default();
            let (a, b) = (entry(from), entry(to));
            graph.0.entry(a.clone()).or_default().insert(b.clone());
            graph.0.entry(b.clone()).or_default();
            let example = format!("{} imports {path} of {}", from.display(), to.display());
            graph.1.entry((a, b)).or_insert(example);
        }
    }
    let mut out = Vec::new();
    for (folder, (edges, examples)) in folders {
        for circle in circles(&edges) {
            let names: Vec<String> = circle.iter().map(|n| n.display().to_string()).collect();
            let mut text = format!("{}:", names.join(", "));
            for ((a, b), example) in &examples {
                if circle.contains(a) && circle.contains(b) {
                    text += &format!("\n    {example}");
                }
            }
            out.push((Path::new(source).join(&folder), text));
        }
    }
    out
}

/// Where a folder's `mod.rs` counts as one of its files.
const STRICT: [&str; 8] = [
    "src/assembly",
    "src/contact/geometry",
    "src/coupling/reduced",
    "src/gpu",
    "src/policy",
    "src/simulate",
    "src/water",
    "python/src",
];

#[test]
fn no_folder_has_import_circles() {
    let mut wrong = Vec::new();
    for source in ["src", "adjoint/src", "python/src"] {
        for (folder, text) in found(source) {
            wrong.push(format!("in {}: {text}", folder.display()));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} import circles:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

#[test]
fn circles_are_found() {
    let edges = |list: &[(u32, u32)]| {
        let mut out: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for (a, b) in list {
            out.entry(*a).or_default().insert(*b);
            out.entry(*b).or_default();
        }
        out
    };
    assert!(circles(&edges(&[(1, 2), (2, 3), (1, 3)])).is_empty());
    let found = circles(&edges(&[(1, 2), (2, 3), (3, 1), (3, 4), (5, 6), (6, 5)]));
    assert_eq!(found, [vec![1, 2, 3], vec![5, 6]]);
}
