//! Contact with each integrator that solves it: rest, sliding, order and gradients; the others refuse.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Fluid, Joint, Plane, Preset, Scene, Shape};
use hydrograd::simulate::Rollout;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};

const GRAVITY: f64 = 9.81;

const INTEGRATORS: [Integrator; 3] = [
    Integrator::MomentumEuler,
    Integrator::Midpoint,
    Integrator::VelocityEuler,
];

/// Above a floor that leans by `slope`, with a contact of these constants.
fn above(slope: f64, contact: Contact) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.add_wall([0.0; 3], [slope.atan().sin(), 0.0, slope.atan().cos()]);
    scene.contact = Some(contact);
    scene
}

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(integrator);
    Simulator::new(scene, settings).unwrap()
}

fn run(simulator: &Simulator, steps: usize) -> Rollout<'_> {
    simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap()
}

/// What the velocity at a state reads of a body at rest under weight: with midpoint the weight's half step is still to come.
fn at_rest(integrator: Integrator, dt: f64) -> f64 {
    match integrator {
        Integrator::Midpoint => -0.5 * GRAVITY * dt,
        _ => 0.0,
    }
}

/// Dropped on the floor it rests where its weight presses it to, at any stiffness.
#[test]
fn a_ball_comes_to_rest() {
    let mass = 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-3;
    for integrator in INTEGRATORS {
        for stiffness in [1e4, 1e6, 1e9] {
            let width = 1e-4;
            let mut scene = above(
                0.0,
                Contact {
                    stiffness: Some(stiffness),
                    gap: Some(0.002),
                    width: Some(width),
                    ..Contact::default()
                },
            );
            let ball = Body::new(Shape::sphere(0.1)).density(1000.0);
            scene.add(ball.at([0.0, 0.0, 0.3]));
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 300);
            let end = &rollout.samples()[300];
            // Depth at which the smoothed law carries the weight.
            let depth = mass * GRAVITY / stiffness;
            let depth = match depth < width {
                true => 2.0 * (width * depth).sqrt() - width,
                false => depth,
            };
            let rest = 0.102 - depth;
            let moved = end.poses[0].translation - rollout.samples()[299].poses[0].translation;
            println!(
                "{integrator:?} {stiffness:.0e}: {:.1e} m off, reads {:.6} m/s, moves {:.1e} m a step",
                end.poses[0].translation.z - rest,
                end.v[2],
                moved.norm(),
            );
            assert!((end.poses[0].translation.z - rest).abs() < 1e-6);
            assert!(moved.norm() < 1e-8);
            let reads = at_rest(integrator, simulator.time_step());
            assert!(
                (end.v[2] - reads).abs() < 1e-6,
                "{} is not {reads}",
                end.v[2]
            );
        }
    }
}

#[test]
fn a_block_sticks_below_the_friction_angle_and_slides_above() {
    let friction = 0.5;
    for integrator in INTEGRATORS {
        for (slope, sticks) in [(0.4_f64, true), (0.6, false)] {
            let mut scene = above(
                slope,
                Contact {
                    friction,
                    ..Contact::default()
                },
            );
            let angle = slope.atan();
            scene.add(
                Body::new(Shape::cuboid([0.3, 0.3, 0.1]))
                    .density(1000.0)
                    .at([0.05 * angle.sin(), 0.0, 0.05 * angle.cos()])
                    .rotated([0.0, angle, 0.0]),
            );
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 200);
            let along = |n: usize| {
                let p = rollout.samples()[n].poses[0].translation;
                p.x * angle.cos() - p.z * angle.sin()
            };
            if sticks {
                let creep = 1e-3 * slope / (friction * friction - slope * slope).sqrt();
                let moved = along(200) - along(20);
                println!("{integrator:?}: creeps {:.2e} m/s", moved / 1.8);
                assert!(moved.abs() <= 1.1 * creep * 1.8, "{integrator:?}: {moved}");
            } else {
                let expected = GRAVITY * (angle.sin() - friction * angle.cos());
                let found = (along(200) - 2.0 * along(150) + along(100)) / 0.25;
                println!("{integrator:?}: slides at {found:.4} m/s², Coulomb {expected:.4}");
                assert!((found - expected).abs() < 0.01 * expected, "{integrator:?}");
            }
        }
    }
}

/// Before anything touches, contact changes no bit.
#[test]
fn nothing_changes_where_nothing_touches() {
    for integrator in INTEGRATORS {
        let mut with = above(0.0, Contact::default());
        let body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.15])).density(1000.0);
        with.add(body.at([0.0, 0.0, 2.0]));
        with.initial.v = vec![1.0, 0.2, -0.5, 0.3, -0.2, 0.4];
        let mut without = with.clone();
        without.contact = None;
        let ends = [with, without].map(|scene| {
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, 20);
            rollout.states()[20].clone()
        });
        assert_eq!(ends[0], ends[1], "{integrator:?}");
    }
}

fn check_gradient(scene: &Scene, fidelity: Fidelity, integrator: Integrator, steps: usize) {
    let end = |scene: &Scene| {
        let simulator = simulator(scene, fidelity, integrator);
        run(&simulator, steps).samples()[steps].q.clone()
    };
    let mut alone = scene.clone();
    (alone.contact, alone.walls) = (None, Vec::new());
    assert!((end(scene) - end(&alone)).norm() > 0.1, "nothing touches");
    let mut simulator = simulator(scene, fidelity, integrator);
    let asked = gradcheck::Settings {
        steps,
        directions: 2,
        seed: 3,
        timings: 0,
    };
    let report = gradcheck(&mut simulator, &asked).unwrap();
    println!(
        "{} {integrator:?}: {:.1e}",
        scene.name, report.max_rel_error
    );
    assert!(
        report.max_rel_error <= 1e-5,
        "{integrator:?}: {:#?}",
        report.directions
    );
}

/// Approach, stick, slip and release, in vacuum and in water.
#[test]
fn gradients_through_contact() {
    let mut sliding = above(0.0, Contact::default());
    sliding.name = "sliding".into();
    sliding.add(
        Body::new(Shape::ellipsoid([0.2, 0.1, 0.15]))
            .density(1000.0)
            .at([0.0, 0.0, 0.17])
            .rotated([0.2, 0.3, 0.0]),
    );
    sliding.initial.v = vec![1.0, 0.2, -0.5, 0.3, -0.2, 0.4];
    let mut pressed = above(0.0, Contact::default());
    pressed.name = "pressed".into();
    let block = Body::new(Shape::cuboid([0.3, 0.2, 0.1])).density(1000.0);
    pressed.add(block.at([0.0, 0.0, 0.051]));
    let ball = Body::new(Shape::sphere(0.08)).density(2000.0);
    pressed.add(ball.at([0.03, 0.02, 0.19]));
    let mut submerged = above(0.0, Contact::default());
    submerged.name = "submerged".into();
    submerged.fluid.density = 1000.0;
    submerged.add(
        Body::new(Shape::sphere(0.1))
            .density(3000.0)
            .at([0.0, 0.0, 0.2])
            .joint(Joint::Planar { plane: Plane::Zx }),
    );
    submerged.initial.v = vec![-0.3, 0.2, 0.0];
    for integrator in INTEGRATORS {
        check_gradient(&sliding, Fidelity::Isolated, integrator, 40);
        check_gradient(&pressed, Fidelity::Isolated, integrator, 40);
        check_gradient(&submerged, Fidelity::Reduced, integrator, 40);
    }
}

#[test]
fn integrators_that_cannot_do_it_say_so() {
    let mut scene = above(0.0, Contact::default());
    let ball = Body::new(Shape::sphere(0.1)).density(1000.0);
    scene.add(ball.at([0.0, 0.0, 0.3]));
    for integrator in [Integrator::Rk2, Integrator::Rk4] {
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let made = Simulator::new(&scene, settings.integrator(integrator));
        let said = made.map(|_| ()).unwrap_err().to_string();
        for word in ["contact", "momentum-euler", "midpoint", "velocity-euler"] {
            assert!(said.contains(word), "no {word} in: {said}");
        }
    }
    let chosen = |scene: &Scene| Settings::for_scene(scene).integrator;
    assert_eq!(chosen(&scene), Integrator::MomentumEuler);
    scene.preset = Preset::Paper;
    assert_eq!(chosen(&scene), Integrator::VelocityEuler);
}
