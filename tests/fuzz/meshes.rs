//! Mesh files of all formats: read, mended, checked, and measured.

use super::engine::{Answer, fuzz, root};
use hydrograd::shape::file;
use std::path::Path;

/// Files of one format.
fn corpus(extension: &str) -> Vec<Vec<u8>> {
    let folder = root().join("tests/fuzz/corpus/mesh");
    let mut names: Vec<_> = (std::fs::read_dir(folder).unwrap())
        .map(|f| f.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    names.sort();
    names
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect()
}

fn read(path: &Path, input: &[u8]) -> Answer {
    std::fs::write(path, input).unwrap();
    let mesh = match file::read_unchecked(path, 1.0) {
        Ok(mesh) => mesh,
        Err(error) => return Answer::Refused(error.to_string()),
    };
    let report = mesh.check();
    let told = report.findings.first().map(|f| format!("{:?}", f.kind));
    let mesh = match mesh.into_mesh() {
        Ok(mesh) => mesh,
        Err(error) => return Answer::Refused(error.to_string()),
    };
    let properties = mesh.mass_properties();
    let numbers = [
        properties.volume,
        mesh.surface_area(),
        mesh.bounding_ball().radius,
        mesh.diameter(),
    ];
    let normals = mesh.vertex_normals();
    let all = numbers.iter().chain(normals.iter().flat_map(|n| n.iter()));
    match all.copied().all(f64::is_finite) && properties.volume > 0.0 {
        true => Answer::Taken(told.unwrap_or_default()),
        false => Answer::Wrong(format!("{numbers:?} of a mesh")),
    }
}

fn hold(target: &'static str, extension: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("mesh.{extension}"));
    fuzz(target, corpus(extension), 10_000, |input| {
        read(&path, input)
    });
}

#[test]
fn obj_files_hold() {
    hold("obj", "obj");
}

#[test]
fn stl_files_hold() {
    hold("stl", "stl");
}

#[test]
fn ply_files_hold() {
    hold("ply", "ply");
}

#[cfg(feature = "urdf")]
#[test]
fn dae_files_hold() {
    hold("dae", "dae");
}
