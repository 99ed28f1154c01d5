//! What a rollout's smallest gap is worth, against coupled panels.

use hydrograd::scene::{Body, Fluid, Scene};
use hydrograd::simulate::{GapCheck, Method};
use hydrograd::{Controls, Fidelity, Settings, Shape, Simulator};

/// One body over a floor, at rest.
fn over_a_floor(shape: Shape, height: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1000.0,
        current: [0.0; 3],
    });
    scene.time_step = 0.01;
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene.add(Body::new(shape).density(1000.0).at([0.0, 0.0, height]));
    scene
}

fn checked(scene: &Scene, settings: &Settings) -> Option<GapCheck> {
    let simulator = Simulator::new(scene, settings.clone()).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 1)).unwrap();
    rollout.check_gap().unwrap()
}

/// A disc flat over a floor at a tenth of its radius, where `reduced` without films is some percent off in M and a third in the force.
#[test]
fn the_smallest_gap_is_checked_against_panels() {
    let (radius, thickness, gap) = (1.0, 0.25, 0.1);
    let scene = |gap: f64| over_a_floor(Shape::cylinder(radius, thickness), gap + 0.5 * thickness);
    let settings = |fidelity| {
        let settings = Settings::default().fidelity(fidelity).faces(320);
        settings.films(fidelity != Fidelity::Reduced)
    };
    let check = checked(&scene(gap), &settings(Fidelity::Reduced)).unwrap();
    println!("{check:?}");
    println!(
        "M {:+.3}, force {:+.3}",
        check.added_mass_error(),
        check.force_error()
    );
    assert_eq!((check.time, check.bodies.1.as_deref()), (0.0, None));
    assert!((check.gap - gap).abs() < 1e-12);
    // Both are what a simulator says, and their slopes those of differences.
    for (k, fidelity) in [Fidelity::Reduced, Fidelity::Full].into_iter().enumerate() {
        let mass = |gap: f64| {
            let simulator = Simulator::new(&scene(gap), settings(fidelity)).unwrap();
            simulator.added_mass().unwrap().matrix[(2, 2)]
        };
        assert!(
            (check.added_mass[k] / mass(gap) - 1.0).abs() < 1e-9,
            "{fidelity:?}"
        );
        let h = 1e-4 * gap;
        let difference = (mass(gap + h) - mass(gap - h)) / (2.0 * h);
        assert!(
            (check.slope[k] / difference - 1.0).abs() < 1e-4,
            "{fidelity:?}"
        );
    }
    assert!((0.01..0.1).contains(&check.added_mass_error()));
    assert!((0.1..0.6).contains(&check.force_error()));
    // Sources lose a part of the force at half a radius; nothing to compare where panels ran, and where there is no water.
    let sources = settings(Fidelity::Full).method(Method::MfsVertex);
    let lost = checked(&scene(0.5), &sources).unwrap();
    println!("{lost:?}");
    assert!(lost.force_error() < -0.1);
    assert_eq!(checked(&scene(gap), &settings(Fidelity::Full)), None);
    let mut dry = scene(gap);
    dry.fluid.density = 0.0;
    assert_eq!(checked(&dry, &settings(Fidelity::Reduced)), None);
}

/// Between two bodies it is the smaller one that moves, whatever their order.
#[test]
fn of_two_bodies_the_smaller_one_is_moved() {
    let mut scene = over_a_floor(Shape::sphere(0.2), 1.0);
    let big = Body::new(Shape::sphere(0.5)).density(1000.0);
    scene.add(big.named("big").at([0.0, 0.3, 1.0 + 0.8]));
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(320);
    let check = checked(&scene, &settings).unwrap();
    println!("{check:?}");
    assert_eq!(check.bodies.1.as_deref(), Some("big"));
    assert!((check.gap - (0.3f64.hypot(0.8) - 0.7)).abs() < 1e-9);
    assert!(check.added_mass_error().abs() < 0.02 && check.force_error().abs() < 0.2);
    // The gap closes the flow off: less added mass when it opens.
    assert!(check.slope.iter().all(|slope| *slope < 0.0));
}
