//! What presses on what it can't move: drives, damping and drag are those of a motion that isn't, and what rolls or slides isn't turned by the way its weight comes to bear.

use crate::support::{check_gradient, run, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Contact, Damping, Drag, DragPart, Fluid, Joint, Motion, Passive, Scene, Servo, Shape,
    Spring,
};
use hydrograd::{Controls, Fidelity, Rollout, Simulator};
use nalgebra::DMatrix;

const GRAVITY: f64 = 9.81;
const INTEGRATORS: [Integrator; 4] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
    Integrator::VelocityEuler,
];

fn dry(dt: f64, friction: f64) -> Scene {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = dt;
    scene.contact = Some(Contact {
        friction,
        ..Contact::default()
    });
    scene
}

fn held(simulator: &Simulator, control: f64, steps: usize) -> Rollout {
    let size = simulator.system().controls;
    let controls = DMatrix::from_element(size, steps, control);
    let controls = Controls::from_matrix(simulator, controls).unwrap();
    simulator.rollout(&controls).unwrap()
}

/// A cube of 0.2 kg on a slide, its face 1 mm from a wall that it is pushed against.
fn finger() -> Body {
    Body::new(Shape::cuboid([0.04; 3]))
        .named("finger")
        .mass(0.2)
        .at([-0.021, 0.0, 0.0])
        .joint(Joint::Prismatic {
            axis: [1.0, 0.0, 0.0],
        })
        .actuated()
}

fn against_wall(dt: f64, finger: Body) -> Scene {
    let mut scene = dry(dt, 0.5);
    scene.fluid = Fluid {
        density: 1.0,
        ..Fluid::fresh_water()
    };
    scene.add_wall([0.0; 3], [-1.0, 0.0, 0.0]);
    scene.add(finger);
    scene
}

fn wall_holds(rollout: &Rollout) -> f64 {
    let forces = rollout.contacts(rollout.steps() - 1, 0.0).unwrap();
    -forces.iter().map(|c| c.force[0]).sum::<f64>()
}

/// τ = k (u − q), whatever the step.
#[test]
fn a_servo_presses_by_its_stiffness() {
    for integrator in INTEGRATORS {
        for (stiffness, dt) in [
            (200.0, 0.01),
            (2e3, 0.02),
            (2e3, 0.01),
            (2e4, 0.01),
            (2e4, 0.0025),
        ] {
            // Taken explicitly it isn't stable when so stiff.
            if integrator == Integrator::VelocityEuler && stiffness > 1e3 {
                continue;
            }
            let scene = against_wall(dt, finger().servo(Servo::new(stiffness, 5.0)));
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = held(&simulator, 0.02, (1.5 / dt).round() as usize);
            let end = rollout.samples().last().unwrap();
            let (pushes, holds) = (stiffness * (0.02 - end.q[0]), wall_holds(&rollout));
            let part = holds / pushes;
            println!(
                "{integrator:?}, {stiffness} N/m, {dt} s: {pushes:.2} N, holds 1 + {:.1e} of it",
                part - 1.0
            );
            assert!(
                (part - 1.0).abs() < 1e-6,
                "{integrator:?}, {stiffness}, {dt}: {part}"
            );
            // And what joints carry at rest is as large.
            let loads = rollout.loads(rollout.steps() - 1).unwrap();
            let acceleration = loads.acceleration()[0];
            assert!(acceleration.abs() < 1e-5 * pushes / 0.2, "{acceleration}");
        }
    }
}

/// Damping at rest is none.
#[test]
fn what_damps_takes_nothing_from_a_push_at_rest() {
    type Damp = fn(&mut Scene, Body) -> Body;
    let slowed: [(&str, Damp); 4] = [
        ("passive", |_, body| {
            body.passive(Passive::default().damping(20.0).friction(0.5))
        }),
        ("drag", |_, body| {
            body.drag(Drag {
                part: DragPart::Total,
                linear: 20.0 / (6.0 * 0.04 * 0.04),
                quadratic_part: DragPart::Normal,
                quadratic: 1.0,
            })
        }),
        ("damping", |scene, body| {
            let damping = Damping::new("finger").linear([20.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            scene.add_force(damping.into());
            body
        }),
        ("spring", |scene, body| {
            let spring = Spring::new("finger").stiffness(10.0).damping(20.0);
            let spring = spring.anchored([1.0, 0.0, 0.0]);
            scene.add_force(spring.into());
            body
        }),
    ];
    for (name, damp) in slowed {
        for integrator in INTEGRATORS {
            for dt in [0.02, 0.0025] {
                let mut scene = against_wall(dt, finger());
                let mut body = scene.bodies.pop().unwrap();
                body = damp(&mut scene, body);
                scene.bodies.push(body);
                let simulator = simulator(&scene, Fidelity::Isolated, integrator);
                let rollout = held(&simulator, 10.0, (1.5 / dt).round() as usize);
                let end = rollout.samples().last().unwrap();
                let pull = if name == "spring" {
                    10.0 * (1.0 - (end.q[0] - 0.021))
                } else {
                    0.0
                };
                let part = wall_holds(&rollout) / (10.0 + pull);
                println!(
                    "{name}, {integrator:?}, {dt} s: holds 1 + {:.1e}",
                    part - 1.0
                );
                assert!(
                    (part - 1.0).abs() < 1e-5,
                    "{name}, {integrator:?}, {dt}: {part}"
                );
            }
        }
    }
}

/// An arm on the stop of its joint: the joint carries the arm's weight, whatever presses it there.
#[test]
fn a_joint_carries_what_its_servo_and_its_stop_leave() {
    let axis = [0.0, 1.0, 0.0];
    for integrator in INTEGRATORS {
        for dt in [0.02, 0.01, 0.0025] {
            let mut scene = Scene::new(Fluid::none());
            scene.gravity = [0.0, 0.0, -GRAVITY];
            scene.time_step = dt;
            let arm = Body::new(Shape::capsule(0.03, 0.3))
                .named("arm")
                .density(2000.0);
            let arm = arm.shape_at([0.0, 0.0, -0.2], [0.0; 3]);
            let arm = arm.joint(Joint::Revolute { axis }).limits([-0.5, 0.3]);
            scene.add(arm.actuated().servo(Servo::new(20.0, 1.0)));
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let steps = (3.0 / dt).round() as usize;
            let rollout = held(&simulator, 1.0, steps);
            let loads = rollout.loads(steps - 1).unwrap();
            let acceleration = loads.acceleration()[0];
            println!("{integrator:?}, {dt} s: {acceleration:.1e} rad/s²");
            // Midpoint's weight is that in the middle of a step without the stop.
            let bound = if integrator == Integrator::Midpoint {
                0.5
            } else {
                1e-6
            };
            assert!(
                acceleration.abs() < bound,
                "{integrator:?}, {dt}: {acceleration}"
            );
        }
    }
}

/// Two fingers hold a ball by friction, by default and at any step.
#[test]
fn servos_hold_what_friction_bears() {
    for dt in [0.02, 0.01, 0.005] {
        let mut scene = dry(dt, 0.5);
        scene.fluid = Fluid::fresh_water();
        scene.gravity = [0.0, 0.0, -GRAVITY];
        for side in [-1.0, 1.0] {
            let axis = [-side, 0.0, 0.0];
            let finger = Body::new(Shape::cuboid([0.02, 0.06, 0.06])).mass(0.2);
            let finger = finger
                .at([0.0505 * side, 0.0, 0.0])
                .joint(Joint::Prismatic { axis });
            scene.add(finger.actuated().servo(Servo::new(5e3, 60.0)));
        }
        scene.add(Body::new(Shape::sphere(0.04)).density(6000.0));
        let settings = hydrograd::Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let rollout = held(&simulator, 0.0084, (1.5 / dt).round() as usize);
        let fell = -rollout.samples().last().unwrap().q[4];
        println!("{dt} s: {fell:.1e} m lower after 1.5 s");
        assert!(fell.abs() < 0.02, "{dt}: {fell}");
    }
}

fn floor(scene: &mut Scene, gravity: [f64; 3]) {
    scene.gravity = gravity;
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
}

/// On a level floor a ball rolls on as fast as it does; down a slope it rolls by 5/7 of what pulls.
#[test]
fn what_rolls_isnt_driven_by_its_weight() {
    for integrator in INTEGRATORS {
        for dt in [0.02, 0.01, 0.0025] {
            let ball = |scene: &mut Scene| {
                let ball = Body::new(Shape::sphere(0.05)).density(2700.0);
                scene.add(ball.at([0.0, 0.0, 0.0506]));
            };
            let mut level = dry(dt, 0.5);
            floor(&mut level, [0.0, 0.0, -GRAVITY]);
            ball(&mut level);
            level.initial.v = vec![0.5, 0.0, 0.0, 0.0, 10.0, 0.0];
            let rollout = run(
                &simulator(&level, Fidelity::Isolated, integrator),
                (2.0 / dt).round() as usize,
            );
            let speed = rollout.samples().last().unwrap().v[0];
            let angle = 0.3_f64;
            let mut slope = dry(dt, 0.5);
            floor(
                &mut slope,
                [GRAVITY * angle.sin(), 0.0, -GRAVITY * angle.cos()],
            );
            ball(&mut slope);
            let rollout = run(
                &simulator(&slope, Fidelity::Isolated, integrator),
                (1.0 / dt).round() as usize,
            );
            let found = rollout.samples().last().unwrap().v[0];
            let part = found / (5.0 / 7.0 * GRAVITY * angle.sin());
            println!(
                "{integrator:?}, {dt} s: rolls at {speed:.5} m/s, down by {part:.5} of 5/7 g sin α"
            );
            assert!((speed - 0.5).abs() < 2e-3, "{integrator:?}, {dt}: {speed}");
            assert!((part - 1.0).abs() < 8e-3, "{integrator:?}, {dt}: {part}");
        }
    }
}

/// A ball at rest on a platform that moves on steadily.
#[test]
fn what_rests_on_what_moves_steadily_rests() {
    let axis = [1.0, 0.0, 0.0];
    for integrator in INTEGRATORS {
        for dt in [0.02, 0.01, 0.0025] {
            let mut scene = dry(dt, 0.5);
            scene.gravity = [0.0, 0.0, -GRAVITY];
            let platform = Body::new(Shape::cuboid([8.0, 1.0, 0.1])).density(2700.0);
            let platform = platform
                .at([0.0, 0.0, -0.05])
                .joint(Joint::Prismatic { axis });
            scene.add(platform.driven(vec![Motion::Linear {
                offset: 0.0,
                rate: 1.0,
            }]));
            let ball = Body::new(Shape::sphere(0.05)).density(2700.0);
            scene.add(ball.at([0.0, 0.0, 0.0506]));
            scene.initial.v = vec![1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, (2.0 / dt).round() as usize);
            let end = &rollout.samples().last().unwrap();
            let way = end.q[1] - end.q[0];
            println!("{integrator:?}, {dt} s: {way:.1e} m from where it lay");
            assert!(way.abs() < 1e-6, "{integrator:?}, {dt}: {way}");
        }
    }
}

/// μ h/2 is under half its breadth: it slides, and doesn't topple.
#[test]
fn what_slides_doesnt_topple() {
    for integrator in INTEGRATORS {
        for dt in [0.02, 0.01] {
            let mut scene = dry(dt, 0.1);
            floor(&mut scene, [0.0, 0.0, -GRAVITY]);
            let block = Body::new(Shape::cuboid([0.05, 0.05, 0.2])).density(2000.0);
            scene.add(block.at([0.0, 0.0, 0.1006]));
            scene.initial.v = vec![3.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let rollout = run(&simulator, (2.0 / dt).round() as usize);
            let tilted = rollout.samples().iter().map(|s| s.q[4].hypot(s.q[5]));
            let tilt = 2.0 * tilted.fold(0.0, f64::max);
            println!("{integrator:?}, {dt} s: leans by {tilt:.4} rad at most");
            assert!(tilt < 0.06, "{integrator:?}, {dt}: {tilt}");
        }
    }
}

/// A gripper by servos in coupled water, its joints damped: against differences, in controls and parameters.
#[test]
fn gradients_are_those_of_the_steps() {
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::EnergyEuler,
        Integrator::Midpoint,
    ] {
        let mut scene = dry(0.01, 0.5);
        scene.fluid = Fluid::fresh_water();
        scene.gravity = [0.0, 0.0, -GRAVITY];
        for side in [-1.0, 1.0] {
            let axis = [-side, 0.0, 0.0];
            let finger = Body::new(Shape::cuboid([0.02, 0.06, 0.06]).faces(120)).mass(0.2);
            let finger = finger
                .at([0.0508 * side, 0.0, 0.0])
                .joint(Joint::Prismatic { axis })
                .limits([-0.1, 0.0001])
                .drag(Drag {
                    part: DragPart::Total,
                    linear: 30.0,
                    quadratic_part: DragPart::Normal,
                    quadratic: 1.0,
                });
            let passive = Passive::default().damping(2.0).friction(0.3);
            scene.add(
                finger
                    .actuated()
                    .servo(Servo::new(3e2, 4.0))
                    .passive(passive),
            );
        }
        scene.add(Body::new(Shape::sphere(0.04).faces(80)).density(2000.0));
        let mut simulator = simulator(&scene, Fidelity::Reduced, integrator);
        check_gradient(
            &format!("gripper, {integrator:?}"),
            &mut simulator,
            12,
            3,
            1e-6,
        );
    }
}
