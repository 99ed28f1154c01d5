//! The grasp: lost by the naive push in water, caught on dry land, and caught in water by forces that a descent finds.

#[allow(dead_code)]
#[path = "../../examples/grasp/hold.rs"]
mod hold;
#[allow(dead_code)]
#[path = "../../examples/grasp/task.rs"]
mod task;

use hydrograd::Fidelity;
use task::Task;

#[test]
fn the_naive_push_catches_on_dry_land_and_loses_in_water() {
    let scene = task::load().unwrap();
    for (scene, caught) in [(task::dry(&scene), true), (scene, false)] {
        let simulator = task::simulator(&scene, Fidelity::Reduced).unwrap();
        let rollout = task::run(&simulator, scene.steps).unwrap();
        assert_eq!(hold::caught(&rollout).unwrap(), caught);
    }
}

#[test]
fn a_descent_finds_forces_that_catch_the_coin() {
    let scene = task::load().unwrap();
    let simulator = task::simulator(&scene, Fidelity::Reduced).unwrap();
    let naive = task::run(&simulator, scene.steps).unwrap();
    let task = Task::new(&scene).unwrap();
    let start = task.through(&naive).unwrap();
    let before = task.cost(&start).unwrap();
    let found = task.find(&start, |_, _| {}).unwrap();
    assert!(found.cost < 0.1 * before, "{} from {before}", found.cost);
    assert!(hold::caught(&task.rollout(&found.x).unwrap()).unwrap());
}

/// The costs' gradients over the knots, against differences: before the fingers touch the coin, and with the coin held.
#[test]
fn gradients_of_the_costs() {
    let task = Task::new(&task::load().unwrap()).unwrap();
    let wavy = |k: usize, scale: f64| scale * (1.3 * k as f64 + 0.7).sin();
    let x: Vec<f64> = (0..33).map(|k| wavy(k, 0.3)).collect();
    let d: Vec<f64> = (0..33).map(|k| wavy(2 * k, 1.0)).collect();
    let h = 1e-5;
    let at = |h: f64| -> Vec<f64> { x.iter().zip(&d).map(|(x, d)| x + h * d).collect() };
    for cost in [Task::approach, Task::hold] {
        let (_, gradient) = cost(&task, &x).unwrap();
        let along: f64 = gradient.iter().zip(&d).map(|(g, d)| g * d).sum();
        let pair = |h: f64| cost(&task, &at(h)).unwrap().0 - cost(&task, &at(-h)).unwrap().0;
        let difference = (8.0 * pair(h) - pair(2.0 * h)) / (12.0 * h);
        let error = (along - difference).abs() / difference.abs();
        println!("{along:.6e} and {difference:.6e}: {error:.1e}");
        assert!(error <= 1e-5, "{along} is not {difference}");
    }
}
