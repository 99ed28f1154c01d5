//! Scenes by chance.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::Placement;
use hydrograd::{
    Body, Controls, Fidelity, Fluid, Joint, Rollout, Scene, Settings, Shape, Simulator,
};
use proptest::prelude::*;
use proptest::test_runner::{Config, FileFailurePersistence};

pub const FIDELITIES: [Fidelity; 3] = [Fidelity::Isolated, Fidelity::Reduced, Fidelity::Full];

/// The same scenes every time; a failure's is printed, and to be written down as a test of its own.
pub fn few(cases: u32) -> Config {
    let more = std::env::var("PROPTEST_CASES").ok();
    Config {
        cases: more.and_then(|n| n.parse().ok()).unwrap_or(cases),
        failure_persistence: Some(Box::new(FileFailurePersistence::Off)),
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        max_shrink_iters: 40,
        ..Config::default()
    }
}

fn length() -> impl Strategy<Value = f64> {
    0.04..0.09
}

fn three(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

pub fn shape() -> impl Strategy<Value = Shape> {
    let made = prop_oneof![
        length().prop_map(Shape::sphere),
        prop::array::uniform3(length()).prop_map(Shape::ellipsoid),
        prop::array::uniform3(length()).prop_map(Shape::cuboid),
        (length(), length()).prop_map(|(r, l)| Shape::cylinder(r, l)),
        (length(), length()).prop_map(|(r, l)| Shape::capsule(0.6 * r, l)),
        (length(), prop::array::uniform3(length()))
            .prop_map(|(l, [a, b, c])| { Shape::prism([[-a, -b], [a, -c], [0.0, b]], l) }),
    ];
    (made, 20..60_usize).prop_map(|(shape, faces)| shape.faces(faces))
}

/// A free body on its place of a line, apart from its neighbours, with its velocity.
fn free(place: usize) -> impl Strategy<Value = (Body, [f64; 6])> {
    let velocity = (three(0.3), three(2.0)).prop_map(|(u, w)| [u[0], u[1], u[2], w[0], w[1], w[2]]);
    (shape(), three(0.03), three(1.5), 500.0..3000.0, velocity).prop_map(
        move |(shape, off, turn, density, velocity)| {
            let at = [0.4 * place as f64 + off[0], off[1], off[2]];
            let mut body = Body::new(shape)
                .density(density)
                .named(format!("body {place}"));
            body.placement = Placement {
                position: at,
                rotation: turn,
            };
            (body, velocity)
        },
    )
}

fn of(bodies: Vec<(Body, [f64; 6])>) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 0.01;
    for (body, velocity) in bodies {
        scene.initial.v.extend(velocity);
        scene.add(body);
    }
    scene
}

/// One to three free bodies in the middle of nothing.
pub fn drifting() -> impl Strategy<Value = Scene> {
    prop_oneof![
        free(0).prop_map(|a| of(vec![a])),
        (free(0), free(1)).prop_map(|(a, b)| of(vec![a, b])),
        (free(0), free(1), free(2)).prop_map(|(a, b, c)| of(vec![a, b, c])),
    ]
}

/// The same, with a link that turns about a hinge, a rail, gravity and drag.
pub fn mechanism() -> impl Strategy<Value = Scene> {
    (drifting(), shape(), three(1.0), any::<bool>()).prop_map(|(mut scene, shape, axis, rail)| {
        let axis = [axis[0], axis[1] + 1.5, axis[2]];
        let joint = match rail {
            true => Joint::Prismatic { axis },
            false => Joint::Revolute { axis },
        };
        let link = Body::new(shape)
            .density(1500.0)
            .named("link")
            .child_of("body 0");
        scene.add(link.at([-0.4, 0.0, 0.0]).joint(joint));
        scene.initial.v.push(0.2);
        scene.gravity = [0.0, 0.0, -9.81];
        scene.bodies[0].drag = Some(hydrograd::scene::Drag {
            linear: 20.0,
            quadratic: 1.0,
            ..Default::default()
        });
        scene
    })
}

pub fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(integrator)
        .tolerance(1e-13);
    Simulator::new(scene, settings).unwrap()
}

pub fn run(scene: &Scene, fidelity: Fidelity, integrator: Integrator, steps: usize) -> Rollout {
    let simulator = simulator(scene, fidelity, integrator);
    simulator
        .rollout(&Controls::zeros(&simulator, steps))
        .unwrap()
}
