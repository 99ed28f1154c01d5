//! The swimmer, alone and beside others: what figures 8 and 9 run.

use crate::plot::{Curve, Panel, draw};
use hydrograd::geometry::Other;
use hydrograd::scene::{Body, Force, Joint, Motion, Plane, Shape};
use hydrograd::{Controls, Fidelity, Result, Rollout, Scene, Settings, Simulator};
use std::error::Error;
use std::path::Path;

/// Faces of a link where it is quick, or as the scene has it.
const QUICK: usize = 80;
/// Steps of a run.
const STEPS: usize = 600;

/// The scene file.
pub fn scene() -> Result<Scene> {
    Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/swimmer.toml"))
}

/// Without its trailing edge.
pub fn without_edge(mut scene: Scene) -> Scene {
    scene
        .forces
        .retain(|force| !matches!(force, Force::Edge(_)));
    scene
}

/// With a small fish ahead, off to the side, which nothing drives.
pub fn with_small_fish(mut scene: Scene) -> Scene {
    let shape = Shape::ellipsoid([0.1, 0.03, 0.06]).faces(500);
    let fish = Body::new(shape).named("small fish").density(998.0);
    scene.add(
        fish.joint(Joint::Planar { plane: Plane::Xy })
            .at([0.35, 0.13, 0.0]),
    );
    scene
}

/// With the beating tail of a large fish beside it, held at its root.
pub fn with_large_tail(mut scene: Scene) -> Scene {
    let shape = Shape::ellipsoid([0.4, 0.05, 0.3]).faces(1280);
    let tail = Body::new(shape).named("large tail").density(998.0);
    let tail = tail
        .shape_at([-0.4, 0.0, 0.0], [0.0; 3])
        .at([0.45, -0.55, 0.0]);
    let beat = Motion::Sine {
        offset: 0.0,
        amplitude: 0.2,
        frequency: 7.0,
        phase: 0.0,
    };
    scene.add(
        tail.joint(Joint::Revolute {
            axis: [0.0, 0.0, 1.0],
        })
        .driven([beat]),
    );
    scene
}

/// Steps of a run.
pub fn steps(quick: bool) -> usize {
    if quick { STEPS / 2 } else { STEPS }
}

/// With the scene's meshes, or coarse ones.
pub fn simulator(scene: &Scene, fidelity: Fidelity, quick: bool) -> Result<Simulator> {
    let settings = Settings::default().fidelity(fidelity);
    let settings = if quick {
        settings.faces(QUICK)
    } else {
        settings
    };
    Simulator::new(scene, settings)
}

/// A run, its own controller bending the swimmer.
pub fn run(scene: &Scene, fidelity: Fidelity, quick: bool) -> Result<Rollout> {
    let simulator = simulator(scene, fidelity, quick)?;
    simulator.rollout(&Controls::zeros(&simulator, steps(quick)))
}

/// The way of the middle of a body's frame in the plane, m.
pub fn path(rollout: &Rollout, body: &str) -> (Vec<f64>, Vec<f64>) {
    let b = (rollout.simulator().scene().body(body)).map_or(0, |id| id.0);
    let places = rollout.samples().iter().map(|s| s.poses[b].translation);
    places.map(|x| (x.x, x.y)).unzip()
}

/// Draws the head's path, and its drift against time, of runs by name.
pub fn draw_drifts(
    picture: &Path,
    runs: &[(&str, &Rollout)],
) -> std::result::Result<(), Box<dyn Error>> {
    let (mut paths, mut drifts) = (Vec::new(), Vec::new());
    for (name, rollout) in runs {
        let (x, y) = path(rollout, "head");
        let time: Vec<f64> = rollout.samples().iter().map(|s| s.time).collect();
        drifts.push(Curve::new(*name, &time, &y));
        paths.push(Curve::new(*name, &x, &y));
    }
    draw(
        picture,
        &[
            Panel::along("path of the head: y, m", "x, m", paths),
            Panel::new("lateral drift of the head, m", drifts),
        ],
    )
}

/// Smallest gap of a run between the swimmer and another body, m.
pub fn smallest_gap(rollout: &Rollout, other: &str) -> f64 {
    let simulator = rollout.simulator();
    let other = simulator.scene().body(other).map_or(0, |id| id.0);
    let states = rollout.samples().iter();
    let gaps = states.flat_map(|s| simulator.gaps().all(&s.poses));
    let to_other = gaps.filter(|g| g.first == other || g.second == Other::Body(other));
    to_other.map(|g| g.distance).fold(f64::INFINITY, f64::min)
}
