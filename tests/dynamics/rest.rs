//! Mechanisms that come to rest under load stay there: forces that cancel leave rounding, beside which nothing moves any more.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Joint, Passive, Scene, Servo, Shape, Spring};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DMatrix;

const INTEGRATORS: [Integrator; 3] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
];
const HINGE: Joint = Joint::Revolute {
    axis: [0.0, 1.0, 0.0],
};

fn water() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene
}

/// A heavy ball on a hinge to the world, 0.3 m out.
fn ball() -> Body {
    Body::new(Shape::sphere(0.1).faces(80))
        .named("ball")
        .density(3000.0)
        .joint(HINGE)
        .shape_at([0.3, 0.0, 0.0], [0.0; 3])
        .actuated()
}

fn alone(ball: Body) -> Scene {
    let mut scene = water();
    scene.add(ball);
    scene
}

fn two_servos() -> Scene {
    let mut scene = alone(ball().servo(Servo::new(500.0, 20.0)));
    scene.add(
        Body::new(Shape::sphere(0.05).faces(80))
            .density(3000.0)
            .child_of("ball")
            .at([0.5, 0.0, 0.0])
            .joint(HINGE)
            .shape_at([0.2, 0.0, 0.0], [0.0; 3])
            .actuated()
            .servo(Servo::new(100.0, 5.0)),
    );
    scene
}

fn sprung() -> Scene {
    let mut scene = alone(ball());
    let spring = Spring::new("ball").at([0.3, 0.0, 0.0]);
    let spring = spring.anchored([0.3, 0.0, 0.1]).stiffness(5000.0);
    scene.add_force(spring.damping(200.0).rest_length(0.05).into());
    scene
}

fn moored() -> Scene {
    let mut scene = water();
    scene.add(
        Body::new(Shape::sphere(0.1).faces(80))
            .named("ball")
            .density(500.0)
            .at([0.3, 0.0, 1.0])
            .drag(Drag {
                part: DragPart::Total,
                linear: 100.0,
                ..Drag::default()
            }),
    );
    let spring = Spring::new("ball").at([0.0, 0.0, -0.1]);
    let spring = spring.anchored([0.0; 3]).stiffness(500.0).rest_length(0.8);
    scene.add_force(spring.damping(20.0).into());
    scene
}

/// Between springs that pull against one another.
fn strung() -> Scene {
    let mut scene = water();
    let ball = Body::new(Shape::sphere(0.1).faces(80)).named("ball");
    scene.add(ball.density(1000.0).at([0.3, 0.0, 1.0]).drag(Drag {
        part: DragPart::Total,
        linear: 200.0,
        ..Drag::default()
    }));
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let along = |from: [f64; 3], length: f64| {
                let mut out = from;
                out[axis] += side * length;
                out
            };
            let spring = Spring::new("ball").at(along([0.0; 3], 0.1));
            let spring = spring.anchored(along([0.3, 0.0, 1.0], 1.37));
            let spring = spring.stiffness(1500.0).rest_length(0.9);
            scene.add_force(spring.damping(20.0).into());
        }
    }
    scene.initial.v = vec![0.3, 0.2, -0.1, 0.5, 0.3, 0.1];
    scene
}

#[test]
fn what_comes_to_rest_stays() {
    let passive = |damping| {
        let passive = Passive::default().stiffness(500.0).rest(0.2);
        alone(ball().passive(passive.damping(damping)))
    };
    let scenes = [
        ("servo", alone(ball().servo(Servo::new(500.0, 20.0)))),
        (
            "stiff servo",
            alone(ball().servo(Servo::new(5000.0, 200.0))),
        ),
        ("two servos", two_servos()),
        ("spring of a joint", passive(20.0)),
        ("damped spring of a joint", passive(200.0)),
        ("spring", sprung()),
        ("moored", moored()),
        ("strung", strung()),
    ];
    for (name, scene) in scenes {
        let mut rests: Vec<f64> = Vec::new();
        for integrator in INTEGRATORS {
            let settings = Settings::default().fidelity(Fidelity::Isolated);
            let simulator = Simulator::new(&scene, settings.integrator(integrator)).unwrap();
            let count = simulator.system().controls;
            let target = DMatrix::from_element(count, 2500, 0.2);
            let controls = Controls::from_matrix(&simulator, target).unwrap();
            let rollout = simulator
                .rollout(&controls)
                .unwrap_or_else(|e| panic!("{name}, {integrator:?}: {e}"));
            let last = rollout.samples().last().unwrap();
            let pieces = rollout.pieces();
            let cut = pieces.iter().enumerate().filter(|(_, n)| **n > 1);
            let cut: Vec<usize> = cut.map(|(n, _)| n).collect();
            println!(
                "{name}, {integrator:?}: at {:?}, {:.1e}",
                last.q.as_slice(),
                last.v.amax()
            );
            assert!(last.v.amax() < 1e-9, "{name}, {integrator:?}: {}", last.v);
            assert!(cut.is_empty(), "{name}, {integrator:?}: {cut:?}");
            rests.push(last.q[0]);
        }
        let apart = rests.iter().map(|x| (x - rests[0]).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-9, "{name}: {rests:?}");
    }
}
