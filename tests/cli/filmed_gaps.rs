//! Pressures in files of VTK where a film comes to carry the gap between two bodies.

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
fn frames_in_which_a_film_carries_a_gap_have_pressures() {
    let scene = closing();
    let rollout = run(&scene);
    let folder = tempfile::tempdir().unwrap();
    let options = vtk::Options {
        frames: Frames::Every(1),
        pressure: true,
        ..vtk::Options::default()
    };
    vtk::write(&rollout, folder.path(), &options).unwrap();
    let mut filmed = 0;
    for n in 0..rollout.samples().len() {
        let known = rollout.pressure(n).unwrap();
        filmed += usize::from(
            known
                .iter()
                .any(|p| p.at_films.iter().any(|share| *share > 0.0)),
        );
        let [pressure, wetted] = ["pressure", "wetted"].map(|name| numbers(folder.path(), n, name));
        let right: Vec<f64> = known.iter().flat_map(|p| p.pressures.clone()).collect();
        assert_eq!(pressure, right);
        assert!(wetted.iter().all(|w| *w == 1.0));
    }
    assert!(filmed > 0 && filmed < rollout.samples().len());

    let mut dry = closing();
    dry.fluid.density = 0.0;
    let said = vtk::write(&run(&dry), folder.path(), &options).unwrap_err();
    says(said, &["density is 0"]);
}
