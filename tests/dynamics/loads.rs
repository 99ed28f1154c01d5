//! Wrenches on bodies and across joints: balances, statics, and what sensors read.

use crate::support::says;
use hydrograd::adjoint::lie::{angular, linear};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Contact, Current, Drag, DragPart, Fluid, Joint, Motion, Passive, Scene, Shape, Site,
};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector, Vector3};

const G: f64 = 9.81;

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// A hull with an actuated arm, a free box beside it and a post that is fixed, over a wall: all feel each other.
fn crowd() -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 998.0,
        current: [0.3, -0.1, 0.0],
    });
    scene.gravity = [0.0, 0.0, -G];
    scene.add_wall([0.0, 0.0, -0.5], [0.0, 0.0, 1.0]);
    let cuboid = |name: &str, size| Body::new(Shape::cuboid(size).faces(108)).named(name);
    let drag = Drag {
        part: DragPart::Total,
        linear: 20.0,
        quadratic_part: DragPart::Normal,
        quadratic: 0.5,
    };
    let hull = cuboid("hull", [0.5, 0.3, 0.2]).density(1020.0).drag(drag);
    scene.add(
        hull.center_of_mass([0.02, 0.01, -0.03])
            .rotated([0.2, -0.1, 0.3]),
    );
    let arm = cuboid("arm", [0.3, 0.06, 0.04]).density(1500.0);
    let arm = arm.at([0.5, 0.0, 0.0]).child_of("hull").actuated();
    let passive = Passive {
        damping: 0.4,
        armature: 0.2,
        ..Passive::default()
    };
    let axis = [0.0, 1.0, 0.0];
    scene.add(arm.joint(Joint::Revolute { axis }).passive(passive));
    let other = cuboid("box", [0.2, 0.2, 0.2]).density(900.0);
    scene.add(other.at([0.1, 0.45, 0.1]));
    let post = cuboid("post", [0.1, 0.1, 0.4]).density(2000.0);
    scene.add(post.at([-0.5, 0.0, 0.0]).joint(Joint::Fixed));
    let tide = Motion::Sine {
        offset: 0.0,
        amplitude: 1.0,
        frequency: 4.0,
        phase: 0.2,
    };
    scene.add_force(Current::new([0.2, 0.1, 0.0]).over_time(tide).into());
    scene.add_site(
        Site::new("imu", "arm")
            .at([0.1, 0.02, 0.0])
            .rotated([0.3, 0.2, 0.1]),
    );
    scene
}

/// Free joints carry nothing (1e-9 of the weight): every body's own balance holds, with the water's part of it in bodies that feel each other. A hinge carries along its axis what its drive
/// gives, less its damping and what the armature takes; and the acceleration is that of the run.
#[test]
fn every_body_is_in_balance() {
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced, Fidelity::Full] {
        let sim = simulator(&crowd(), fidelity, Integrator::Rk4);
        let rising = DMatrix::from_fn(1, 6, |_, n| 1.5 + n as f64);
        let controls = Controls::from_matrix(&sim, rising).unwrap();
        let rollout = sim.rollout(&controls).unwrap();
        for n in [0, 3, 5] {
            let loads = rollout.loads(n).unwrap();
            let weight = sim.parameters().mass(0) * G;
            for (b, name) in [(0, "hull"), (2, "box")] {
                let left = loads.joints()[b].norm() / weight;
                assert!(left < 1e-9, "{fidelity:?} {n} {name}: {left:.1e}");
            }
            let v = rollout.samples()[n].v[6];
            let hinge = loads.joint_forces()[6];
            let driven = 1.5 + n as f64 - 0.4 * v - 0.2 * loads.acceleration()[6];
            assert!((hinge - driven).abs() < 1e-9 * weight, "{hinge} {driven}");
            // What holds the post is against all that acts on it.
            let sum: Vector3<f64> = (loads.kinds())
                .map(|kind| linear(&loads.wrenches(kind).unwrap()[3]))
                .sum();
            assert!((linear(&loads.joints()[3]) + sum).norm() < 1e-9 * weight);
        }
        let [a, b] = [2, 4].map(|n| rollout.samples()[n].v.clone());
        let dt = sim.time_step();
        let slope = (b - a) / (2.0 * dt);
        let found = rollout.loads(3).unwrap().acceleration().clone();
        let error = (&slope - &found).norm() / found.norm();
        println!("{fidelity:?}: {error:.1e}");
        // The control changes between the steps: the hinge's own is the mean of two.
        assert!(error < 0.3, "{fidelity:?}: {error:.1e}");
        let water = rollout
            .loads(3)
            .unwrap()
            .wrenches("water")
            .unwrap()
            .to_vec();
        assert!(water[0].norm() > 0.0 && rollout.loads(3).unwrap().wrenches("magic").is_none());
        if fidelity == Fidelity::Isolated {
            assert_eq!(linear(&water[3]), Vector3::zeros());
        }
    }
}

/// Statics: an arm of two links that hangs in the air aslant, locked: its weight and moment at the root, and 1 g in a sensor on it, its own axes.
#[test]
fn what_is_held_weighs_on_its_joints() {
    let mut scene = Scene::new(Fluid::none());
    scene.gravity = [0.0, 0.0, -G];
    let link = |name: &str, mass: f64| {
        let body = Body::dry()
            .named(name)
            .mass(mass)
            .inertia([0.01, 0.02, 0.03]);
        let axis = [0.0, 1.0, 0.0];
        body.joint(Joint::Revolute { axis }).locked()
    };
    scene.add(link("upper", 2.0).center_of_mass([0.3, 0.0, 0.0]));
    let lower = link("lower", 1.0).center_of_mass([0.2, 0.1, 0.0]);
    scene.add(lower.at([0.6, 0.0, 0.0]).child_of("upper"));
    scene.add_site(Site::new("sensor", "lower").rotated([0.0, 0.3, 0.0]));
    scene.initial.q = vec![0.5, -0.2];
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 1)).unwrap();
    for n in [0, 1] {
        let loads = rollout.loads(n).unwrap();
        let (a, b) = (0.5_f64, 0.3_f64);
        // Where the centres are, along x and y.
        let tip = 0.6 * a.cos();
        let (upper, lower) = (0.3 * a.cos(), [tip + 0.2 * b.cos(), 0.1]);
        let root = loads.joints()[0];
        assert!((linear(&root) - Vector3::z() * 3.0 * G).norm() < 1e-12 * G);
        let moment = Vector3::new(G * lower[1], -G * (2.0 * upper + lower[0]), 0.0);
        assert!(
            (angular(&root) - moment).norm() < 1e-12 * G,
            "{root:?} {moment:?}"
        );
        assert!((loads.joint_forces()[0] - moment.y).abs() < 1e-12 * G);
        assert!((loads.joint_forces()[1] + G * 0.2 * b.cos()).abs() < 1e-12 * G);
        let read = rollout.imu("sensor", n).unwrap();
        // Turned by 0.5 − 0.2 + 0.3 about y.
        let turned = 0.6_f64;
        let up = Vector3::new(-turned.sin(), 0.0, turned.cos()) * G;
        assert!((read.specific_force - up).norm() < 1e-12 * G, "{read:?}");
        assert_eq!(read.rates, Vector3::zeros());
    }
}

/// A sensor on a body that spins about an axis and falls: the centripetal acceleration alone, and the rate.
#[test]
fn a_sensor_that_falls_and_spins() {
    let mut scene = Scene::new(Fluid::none());
    scene.gravity = [0.0, 0.0, -G];
    scene.time_step = 1e-3;
    scene.add(
        Body::dry()
            .named("top")
            .mass(1.0)
            .inertia([0.02, 0.02, 0.03]),
    );
    scene.add_site(
        Site::new("rim", "top")
            .at([0.2, 0.0, 0.0])
            .rotated([0.0, 0.0, 0.4]),
    );
    scene.initial.v = vec![1.0, 0.0, 0.0, 0.0, 0.0, 5.0];
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 50)).unwrap();
    let read = rollout.imu("rim", 40).unwrap();
    let inward = Vector3::new(-(0.4_f64.cos()), 0.4_f64.sin(), 0.0) * 25.0 * 0.2;
    assert!((read.specific_force - inward).norm() < 1e-9, "{read:?}");
    assert!((read.rates - Vector3::z() * 5.0).norm() < 1e-9);
}

/// Contact carries what buoyancy doesn't, to first order in the time step: a ball that lies on a wall; and a stop of a joint holds an arm up.
#[test]
fn contact_and_stops_are_among_the_loads() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -G];
    scene.time_step = 2e-3;
    scene.contact = Some(Contact::default());
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let ball = Body::new(Shape::sphere(0.1).faces(320)).named("ball");
    let drag = Drag {
        part: DragPart::Total,
        linear: 300.0,
        ..Drag::default()
    };
    scene.add(ball.density(3000.0).at([0.0, 0.0, 0.1005]).drag(drag));
    let arm = Body::dry()
        .named("arm")
        .mass(1.0)
        .inertia([0.01, 0.01, 0.01]);
    let arm = arm.at([0.0, 2.0, 1.0]).center_of_mass([0.5, 0.0, 0.0]);
    let axis = [0.0, 1.0, 0.0];
    let passive = Passive {
        damping: 0.5,
        ..Passive::default()
    };
    scene.add(
        arm.joint(Joint::Revolute { axis })
            .limits([-0.3, 0.3])
            .passive(passive),
    );
    scene.initial.q = [start_of_a_ball(), vec![0.29]].concat();
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::MomentumEuler);
    let rollout = sim.rollout(&Controls::zeros(&sim, 1500)).unwrap();
    let loads = rollout.loads(1499).unwrap();
    let ball = |kind: &str| linear(&loads.wrenches(kind).unwrap()[0]).z;
    let carried = -ball("gravity") - ball("buoyancy");
    // The step's own drag, at the velocity before contact, carries a little.
    assert!(
        (ball("contact") / carried - 1.0).abs() < 0.01,
        "{} {carried}",
        ball("contact")
    );
    assert!(loads.joints()[0].norm() < 1e-9 * carried);
    let hinge = loads.joint_forces()[1 + 5];
    // 0.5 m · g · cos 0.3, which the stop takes.
    let weight = -0.5 * G * 0.3_f64.cos();
    assert!((hinge / weight - 1.0).abs() < 0.01, "{hinge} {weight}");
    says(rollout.loads(1501).unwrap_err(), &["1501", "at most 1500"]);
    says(rollout.imu("nose", 0).unwrap_err(), &["imu: site", "nose"]);
}

fn start_of_a_ball() -> Vec<f64> {
    vec![0.0, 0.0, 0.1005, 1.0, 0.0, 0.0, 0.0]
}

/// Asked of the equations, with an acceleration of one's own: joints take what is missing, as inverse dynamics has it.
#[test]
fn loads_are_those_of_inverse_dynamics() {
    let sim = simulator(&crowd(), Fidelity::Reduced, Integrator::Rk4);
    let (q, v) = sim.start();
    let at = sim.equations_at(q, 0.3).unwrap();
    let n = v.len();
    let wavy = |phase: f64| DVector::from_fn(n, |i, _| (1.3 * i as f64 + phase).sin());
    let (v, acceleration, u) = (0.4 * wavy(0.2), wavy(1.1), DVector::from_element(1, 2.0));
    let loads = at.loads(&v, &u, &acceleration).unwrap();
    let force = at.force(&v, &acceleration, &u).unwrap();
    let mut known = loads.joint_forces().clone();
    // The drive, its damping and its armature are in the hinge's.
    known[6] += 0.2 * acceleration[6] - 2.0 + 0.4 * v[6];
    assert!(
        (&known - &force).norm() < 1e-10 * force.norm(),
        "{known:?} {force:?}"
    );
}
