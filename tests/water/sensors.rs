//! Sensors in the water: what they read, and gradients of what they read.

use crate::support::says;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::objective::{effort, final_flow, final_pressure, mean_flow, mean_pressure};
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::{Method, Sensor};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DMatrix;

const ALL: [(Fidelity, Method); 4] = [
    (Fidelity::Isolated, Method::Auto),
    (Fidelity::Reduced, Method::Auto),
    (Fidelity::Full, Method::Panel),
    (Fidelity::Full, Method::MfsVertex),
];

/// A driven fish beside a stone that is free to go.
fn scene() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.fluid.current = [0.1, 0.05, 0.0];
    let mut fish = Body::new(Shape::ellipsoid([0.3, 0.1, 0.15])).density(1050.0);
    fish.name = "fish".into();
    scene.add(fish.actuated());
    let stone = Body::new(Shape::sphere(0.15)).density(1100.0);
    scene.add(stone.at([0.1, 0.6, 0.05]));
    scene.initial.v = vec![0.5, 0.1, 0.0, 0.0, 0.1, 0.3, 0.0, -0.2, 0.1, 0.0, 0.0, 0.0];
    scene
}

fn simulator((fidelity, method): (Fidelity, Method), faces: usize) -> Simulator {
    let settings = Settings::default().fidelity(fidelity).method(method);
    Simulator::new(
        &scene(),
        settings.faces(faces).time_step(0.02).tolerance(1e-12),
    )
    .unwrap()
}

fn pushed(simulator: &Simulator, h: f64) -> Rollout {
    let push = DMatrix::from_fn(6, 4, |i, n| {
        (1.0 + h) * (0.3 + 0.1 * i as f64 - 0.05 * n as f64)
    });
    let controls = Controls::from_matrix(simulator, push).unwrap();
    simulator.rollout(&controls).unwrap()
}

fn sensors() -> [Sensor; 2] {
    [
        Sensor::fixed([0.5, 0.4, 0.1]),
        Sensor::on("fish", [-0.05, 0.24, 0.02]),
    ]
}

#[test]
fn they_read_the_flow() {
    for way in ALL {
        let rollout = pushed(&simulator(way, 320), 0.0);
        let sensors = sensors();
        for n in [0, 4] {
            let at = |s: &Sensor| match s.body {
                Some(_) => rollout.samples()[n].poses[0].apply(&s.at.into()),
                None => Vec3::from(s.at),
            };
            let points: Vec<Vec3> = sensors.iter().map(at).collect();
            let flow = rollout.flow(n, &points).unwrap();
            let read = rollout.sensor_flow(n, &sensors).unwrap();
            // Full has two meshes, or sources.
            let most = if way.0 == Fidelity::Full { 0.02 } else { 1e-12 };
            for (a, b) in flow.iter().zip(&read) {
                assert!((a - b).norm() < most * b.norm(), "{way:?}: {a} {b}");
            }
        }
        // Nothing touches, so that the mean acceleration over a step is nearly that at its start.
        let points: Vec<Vec3> = sensors.iter().map(|s| s.at.into()).collect();
        let pressure = rollout.flow_pressure(0, &points).unwrap();
        let read = rollout.sensor_pressure(0, &sensors).unwrap();
        for (a, b) in pressure.iter().zip(&read) {
            println!("{way:?}: {a} {b}");
            assert!((a - b).abs() < 0.05 * a.abs().max(5.0), "{way:?}: {a} {b}");
        }
    }
}

/// Objectives of readings, along a change of all controls, against central differences.
#[test]
fn objectives_of_readings_have_gradients() {
    let [fixed, carried] = sensors();
    let goal = final_flow(fixed.clone(), [0.2, 0.0, 0.1], 3.0)
        + mean_flow(carried.clone(), [0.0, 0.1, 0.0], 2.0)
        + final_pressure(carried, 10.0, 1e-3)
        + mean_pressure(fixed, -5.0, 2e-3)
        + effort(1e-3);
    for way in ALL {
        let simulator = simulator(way, 80);
        let rollout = pushed(&simulator, 0.0);
        let gradient = rollout.gradient(&goal).unwrap();
        let slope = gradient.controls.dot(rollout.controls());
        let value = |h: f64| pushed(&simulator, h).value(&goal).unwrap();
        let best = [1e-2, 1e-3, 1e-4]
            .map(|h| ((value(h) - value(-h)) / (2.0 * h) / slope - 1.0).abs())
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        println!("{way:?}: {best:.1e}");
        assert!(best < 1e-6, "{way:?}: {best}");
        assert!(gradient.parameters.density() != 0.0);
    }
}

#[test]
fn what_cannot_be_read_is_told_by_name() {
    let rollout = pushed(&simulator(ALL[1], 80), 0.0);
    let refused = |sensor: Sensor, says: &[&str]| {
        let error = rollout
            .sensor_flow(0, &[Sensor::fixed([1.0; 3]), sensor])
            .unwrap_err();
        let text = error.to_string();
        assert!(says.iter().all(|s| text.contains(s)), "{text}");
    };
    refused(
        Sensor::fixed([0.0, f64::NAN, 0.0]),
        &["sensors[1].at", "finite"],
    );
    refused(Sensor::fixed([0.0; 3]), &["sensors[1]", "body \"fish\""]);
    refused(
        Sensor::on("fish", [0.0, 0.101, 0.0]),
        &["sensors[1]", "body \"fish\""],
    );
    refused(
        Sensor::on("shark", [1.0; 3]),
        &["sensors[1]", "shark", "fish"],
    );
    refused(Sensor::on("shark", [1.0; 3]), &["must be one of"]);
    let one = [Sensor::fixed([1.0; 3])];
    assert!(rollout.sensor_flow(5, &one).is_err());
    assert!(
        rollout
            .sensor_flow(0, &vec![one[0].clone(); 1_000_001])
            .is_err()
    );
    let bar = DMatrix::zeros(2, 5);
    let text = rollout
        .sensor_vjp(&one, Some(&bar), None)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("cotangents.flow") && text.contains("(3, 5)"),
        "{text}"
    );
    let goal = final_flow(Sensor::on("fish", [0.0; 3]), [0.0; 3], 1.0);
    assert!(
        rollout
            .value(&goal)
            .unwrap_err()
            .to_string()
            .contains("fish")
    );
    // Nothing is asked for: nothing is solved, and nothing comes back.
    let none = rollout
        .sensor_vjp(&one, Some(&DMatrix::zeros(3, 5)), None)
        .unwrap();
    assert_eq!(none, rollout.zero_cotangents());

    let simulator = simulator(ALL[1], 80);
    let still = simulator.rollout(&Controls::zeros(&simulator, 0)).unwrap();
    let text = still.sensor_pressure(0, &one).unwrap_err().to_string();
    assert!(text.contains("without steps"), "{text}");
}

/// Where a film is there are readings, but no derivatives of them: the gradient says that, and what there is instead.
#[test]
fn gradients_beside_a_film_say_why_there_is_none() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.time_step = 1e-3;
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let ball = Body::new(Shape::sphere(0.03)).density(2700.0);
    scene.add(ball.at([0.0, 0.0, 0.0309]));
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let goal = mean_pressure(Sensor::fixed([0.3, 0.0, 0.1]), 3.0, 1.0);
    let simulator = Simulator::new(&scene, settings.clone()).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
    assert!(rollout.value(&goal).unwrap() > 0.0);
    let error = rollout.gradient(&goal).unwrap_err();
    says(error, &["film", "films = false", "full"]);
    let simulator = Simulator::new(&scene, settings.films(false)).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
    assert!(rollout.gradient(&goal).is_ok());
}
