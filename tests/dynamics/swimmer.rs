//! A fish that swims by a wave of joint angles: its gradients, and what drives it.

use crate::support::says;
use hydrograd::scene::{Body, Controller, Force, Joint, Plane, Scene, Shape};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator, objective};
use std::path::Path;

fn scene() -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = Scene::load(root.join("examples/scenes/swimmer.toml")).unwrap();
    // Within the second that it takes the wave to rise there would be little to see.
    if let Some(Controller::Wave { rise, bias, .. }) = &mut scene.controller {
        (*rise, *bias) = (0.1, 0.05);
    }
    let fish = Body::new(Shape::ellipsoid([0.1, 0.03, 0.06])).named("fish");
    let fish = fish.density(998.0).at([0.1, 0.15, 0.0]);
    scene.add(fish.joint(Joint::Planar { plane: Plane::Xy }));
    scene
}

fn run(simulator: &Simulator) -> Rollout {
    simulator.rollout(&Controls::zeros(simulator, 60)).unwrap()
}

/// The head's way and the small fish's place, by all gains of the wave, against central differences.
#[test]
fn gains_have_gradients_through_coupled_water() {
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(80);
    let simulator = Simulator::new(&scene(), settings.tolerance(1e-12)).unwrap();
    let goal = objective::final_position("head", [1.0, 0.2, 0.0])
        + objective::final_position("fish", [0.0, 0.4, 0.0]);
    let gradient = run(&simulator).gradient(&goal).unwrap().gains;
    let gains = simulator.policy().gains();
    assert_eq!((gains.len(), gradient.len()), (8, 8));
    for k in 0..8 {
        let h = 1e-5 * gains[k].abs();
        let value = |by: f64| {
            let mut gains = gains.clone();
            gains[k] += by;
            let mut moved = simulator.clone();
            moved.set_policy(simulator.policy().with_gains(&gains).unwrap());
            run(&moved).value(&goal).unwrap()
        };
        let difference = (value(h) - value(-h)) / (2.0 * h);
        let off = (gradient[k] - difference).abs() / difference.abs();
        assert!(off < 1e-6, "gain {k}: {} {difference}", gradient[k]);
    }
}

#[test]
fn gains_that_can_not_be_are_refused() {
    let settings = Settings::default().fidelity(Fidelity::Isolated).faces(80);
    let simulator = Simulator::new(&scene(), settings).unwrap();
    let policy = simulator.policy();
    for (k, bad, word) in [(4, 0.0, "length"), (3, f64::NAN, "finite")] {
        let mut gains = policy.gains();
        gains[k] = bad;
        let said = policy.with_gains(&gains).err().unwrap();
        says(said, &[&format!("gains[{k}]"), word]);
    }
}

/// What the trailing edge leaves in the water is the thrust.
#[test]
fn without_its_edge_it_stays() {
    let way = |scene: &Scene| {
        let settings = Settings::default().fidelity(Fidelity::Isolated).faces(80);
        let simulator = Simulator::new(scene, settings).unwrap();
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, 300))
            .unwrap();
        let x = |n: usize| rollout.samples()[n].poses[0].translation.x;
        x(300) - x(0)
    };
    let mut bare = scene();
    bare.forces.retain(|f| !matches!(f, Force::Edge(_)));
    let (swims, stays) = (way(&scene()), way(&bare));
    assert!(swims > 0.2 && stays.abs() < 0.1 * swims, "{swims} {stays}");
}
