//! Pressures in files of VTK where a film comes to carry the gap between two bodies.

use crate::support::command::hydrograd;
use crate::support::says;
use hydrograd::output::{Frames, vtk};
use hydrograd::{Body, Controls, Fidelity, Fluid, Rollout, Scene, Settings, Shape, Simulator};
use std::path::Path;
use vtkio::Vtk;
use vtkio::model::{Attribute, DataSet, Piece};

/// A ball that comes towards another from 0.3 m to where a film carries their gap.
fn closing() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.name = "closing".into();
    for x in [0.0, 1.3] {
        let ball = Body::new(Shape::sphere(0.5));
        scene.add(ball.density(900.0).at([x, 0.0, 0.0]));
    }
    scene.initial.v = vec![0.0; 12];
    scene.initial.v[6] = -1.0;
    (scene.steps, scene.time_step) = (7, 0.04);
    scene
}

fn run(scene: &Scene) -> Rollout {
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(80);
    let simulator = Simulator::new(scene, settings).unwrap();
    let controls = Controls::zeros(&simulator, scene.steps);
    simulator.rollout(&controls).unwrap()
}

fn numbers(folder: &Path, frame: usize, name: &str) -> Vec<f64> {
    let path = folder.join(format!("bodies/bodies_{frame:05}.vtp"));
    let DataSet::PolyData { mut pieces, .. } = Vtk::import(path).unwrap().data else {
        panic!();
    };
    let Piece::Inline(piece) = pieces.remove(0) else {
        panic!();
    };
    let found = piece.data.cell.iter().find(|a| a.name() == name).unwrap();
    let Attribute::DataArray(array) = found else {
        panic!();
    };
    array.data.cast_into().unwrap()
}

#[test]
fn frames_in_which_a_film_carries_a_gap_are_written_without_pressure() {
    let scene = closing();
    let rollout = run(&scene);
    let folder = tempfile::tempdir().unwrap();
    let options = vtk::Options {
        frames: Frames::Every(1),
        pressure: true,
        ..vtk::Options::default()
    };
    let written = vtk::write(&rollout, folder.path(), &options).unwrap();
    let mut unknown = Vec::new();
    for (n, sample) in rollout.samples().iter().enumerate() {
        let known = rollout.known_pressure(n).unwrap();
        assert_eq!(known.is_some(), rollout.pressure(n).is_ok());
        let [pressure, hydrostatic, wetted] =
            ["pressure", "hydrostatic", "wetted"].map(|name| numbers(folder.path(), n, name));
        let faces = rollout.simulator().faces();
        assert_eq!((pressure.len(), wetted.len()), (faces, faces));
        match known {
            Some(known) => {
                let right: Vec<f64> = known.iter().flat_map(|p| p.pressures.clone()).collect();
                assert_eq!(pressure, right);
                assert!(wetted.iter().all(|w| *w == 1.0));
            }
            None => {
                unknown.push(sample.time);
                let all = [pressure, hydrostatic, wetted].concat();
                assert!(all.iter().all(|x| *x == 0.0));
            }
        }
    }
    assert!(!unknown.is_empty() && unknown.len() < rollout.samples().len());
    assert_eq!(written.without_pressure, unknown);
    let [warning] = &written.warnings()[..] else {
        panic!();
    };
    let said = [
        format!("unknown in {} frames", unknown.len()),
        "films".into(),
        "wetted 0".into(),
    ];
    says(warning, &said.each_ref().map(String::as_str));

    // What isn't a film's doing is an error still.
    let mut dry = closing();
    dry.fluid.density = 0.0;
    let said = vtk::write(&run(&dry), folder.path(), &options).unwrap_err();
    says(said, &["density is 0"]);
}

#[test]
fn the_program_says_so_once() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str| folder.path().join(name).display().to_string();
    let (scene, out) = (of("closing.toml"), of("vtk"));
    std::fs::write(&scene, closing().to_toml().unwrap()).unwrap();
    let done = hydrograd(&[
        "run",
        &scene,
        "--fidelity",
        "reduced",
        "--faces",
        "80",
        "--vtk",
        &out,
        "--vtk-pressure",
        "--frames-per-second",
        "100",
    ]);
    let said = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.success(), "{said}");
    assert_eq!(
        said.matches("vtk: pressure: unknown in").count(),
        1,
        "{said}"
    );
}
