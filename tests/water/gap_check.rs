//! What a rollout's smallest gap is worth, against coupled panels.

use hydrograd::scene::{Body, Fluid, Joint, Scene};
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
        if fidelity == Fidelity::Full {
            // At a unit speed the force is half the slope; of M that goes as 1/h it would be M/2h.
            let share = 0.5 * difference.abs() / (0.5 * mass(gap) / gap);
            assert!((check.force_share() / share - 1.0).abs() < 1e-4);
            assert!((0.1..1.0).contains(&share), "{share}");
        }
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

/// A post that is fixed a millimetre over the floor, and a ball that moves farther from it.
fn post_and_ball() -> Scene {
    let mut scene = over_a_floor(Shape::sphere(0.1), 0.15);
    let post = Body::new(Shape::cuboid([0.05, 0.05, 0.3])).density(1000.0);
    scene.add(post.named("post").at([0.5, 0.0, 0.151]).fixed());
    scene.initial.v = vec![0.0, 0.0, -0.1, 0.0, 0.0, 0.0];
    scene
}

/// What rests in the world doesn't come nearer to a wall: its gap there is none of the run's, and no contact.
#[test]
fn what_rests_at_a_wall_is_no_gap() {
    let mut scene = post_and_ball();
    scene.contact = Some(Default::default());
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced] {
        let settings = Settings::default().fidelity(fidelity);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
        let gap = rollout.gaps()[0].unwrap();
        assert!((gap.distance - 0.05).abs() < 1e-9, "{gap:?}");
        let contacts = rollout.contacts(0, 1.0).unwrap();
        assert!(contacts.iter().all(|c| c.first == 0), "{contacts:?}");
        // Reaching through it is refused all the same where the flow has no meaning then.
        let mut through = scene.clone();
        through.bodies[1].placement.position[2] = 0.1;
        let settings = Settings::default().fidelity(fidelity);
        let refused = Simulator::new(&through, settings).is_err();
        assert_eq!(refused, fidelity == Fidelity::Reduced);
    }
}

/// By its own added mass a body is checked that has some: here the larger one, the other being fixed.
#[test]
fn a_fixed_neighbour_is_not_taken_for_what_moves() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let half = 0.5 * scene.fluid.density * 4.0 / 3.0 * std::f64::consts::PI * 0.008;
    let ball = Body::new(Shape::sphere(0.2)).density(1000.0).named("ball");
    let post = Body::new(Shape::sphere(0.05)).density(1000.0).named("post");
    let post = post.at([0.27, 0.0, 0.0]).fixed();
    // Whichever comes first: what is fixed isn't in the water of the run, and is in that of the panels.
    for bodies in [[&post, &ball], [&ball, &post]] {
        scene.bodies.clear();
        scene.time_step = 0.01;
        for body in bodies {
            scene.add(body.clone());
        }
        let check = checked(&scene, &Settings::default().fidelity(Fidelity::Isolated)).unwrap();
        assert_eq!(check.bodies, ("ball".into(), Some("post".into())));
        assert!((check.added_mass[0] / half - 1.0).abs() < 1e-3);
        assert!((check.added_mass[1] / half - 1.0).abs() < 0.1);
    }
    // Nothing that moves has a surface.
    scene.bodies[0].shape = None;
    (scene.bodies[0].density, scene.bodies[0].mass) = (None, Some(1.0));
    scene.bodies[0].inertia = Some(vec![0.1; 3]);
    scene.add_wall([0.0, 0.0, -0.06], [0.0, 0.0, 1.0]);
    assert!(checked(&scene, &Settings::default().fidelity(Fidelity::Isolated)).is_none());
}

/// Of a thin plate that is fixed and a ball that isn't the ball's added mass counts, though the plate is smaller.
#[test]
fn the_body_that_moves_is_checked() {
    let mut scene = Scene::new(Fluid {
        density: 1000.0,
        current: [0.0; 3],
    });
    scene.time_step = 0.01;
    let plate = Body::new(Shape::cuboid([0.01, 0.3, 0.3]).faces(300)).named("plate");
    scene.add(plate.density(7000.0).joint(Joint::Fixed));
    let ball = Body::new(Shape::sphere(0.065).faces(320)).named("ball");
    scene.add(ball.density(1000.0).at([0.09, 0.0, 0.0]));
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let check = checked(&scene, &settings).unwrap();
    println!("{check:?}");
    assert_eq!(check.bodies, ("ball".into(), Some("plate".into())));
    let own = 0.5 * 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.065_f64.powi(3);
    assert!(check.added_mass.iter().all(|m| *m > own && *m < 2.0 * own));
}
