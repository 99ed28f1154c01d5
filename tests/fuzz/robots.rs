//! Robots in URDF files: read, reported, checked, written as bodies and read again.

use super::engine::{Answer, corpus, fuzz, root};
use hydrograd::scene::{Followers, Robot, Scene};
use hydrograd::{Fluid, MassProperties};
use std::path::Path;

/// What a file comes to, every number of which must be finite.
fn made(path: &Path, input: &[u8], options: &Robot) -> Answer {
    std::fs::write(path, input).unwrap();
    let mut scene = Scene::new(Fluid::fresh_water());
    let report = match scene.add_robot(path, options) {
        Ok(added) => added.report,
        Err(error) => return Answer::Refused(error.to_string()),
    };
    let mut numbers = vec![report.mass, report.volume, report.weight, report.buoyancy];
    numbers.extend(report.center_of_mass);
    numbers.extend(report.center_of_buoyancy.into_iter().flatten());
    for body in &report.bodies {
        numbers.extend([body.mass, body.volume]);
        numbers.extend(body.center_of_mass);
    }
    if !numbers.iter().all(|x| x.is_finite()) {
        return Answer::Wrong(format!("numbers that aren't finite: {report:?}"));
    }
    if let Err(error) = scene.validate() {
        return Answer::Refused(error.to_string());
    }
    for body in &scene.bodies {
        let Some(shape) = &body.shape else { continue };
        match hydrograd::shape::build(shape, Path::new(""), Some(20)) {
            Ok(mesh) if MassProperties::of(&mesh).volume > 0.0 => {}
            Ok(_) => return Answer::Wrong(format!("{:?} has no volume", body.name)),
            Err(error) => return Answer::Wrong(format!("{:?}: {error}", body.name)),
        }
    }
    let text = match scene.to_toml() {
        Ok(text) => text,
        Err(error) => return Answer::Refused(error.to_string()),
    };
    match Scene::from_toml(&text, "") {
        Ok(again) if again == scene => {
            Answer::Taken(format!("{} {}", scene.bodies.len(), report.notes.concat()))
        }
        Ok(_) => Answer::Wrong("a robot reads back as another".into()),
        Err(error) => Answer::Wrong(format!("a robot doesn't read back: {error}")),
    }
}

#[test]
fn robots_hold() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = root().join("tests/fuzz/corpus/mesh");
    for mesh in ["cube.obj", "tetra.dae"] {
        std::fs::copy(meshes.join(mesh), folder.path().join(mesh)).unwrap();
    }
    let path = folder.path().join("robot.urdf");
    let options = Robot {
        faces: Some(40),
        // The folder of the meshes is the package `mesh`.
        package_path: vec![root().join("tests/fuzz/corpus")],
        ..Robot::default().mimic(Followers::Independent)
    };
    fuzz("robots", corpus("robot"), 300, |input| {
        made(&path, input, &options)
    });
}
