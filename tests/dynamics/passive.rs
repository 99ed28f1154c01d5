//! Joints with springs, damping, friction and armatures, and joints that follow others.

use crate::support::INTEGRATORS;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Controller, Fluid, Joint, Mimic, Passive, Scene, Servo, Shape, Spring,
};
use hydrograd::simulate::gradcheck::{GradcheckSettings, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

const AXIS: [f64; 3] = [1.0, 0.0, 0.0];

fn dry(name: &str, mass: f64) -> Body {
    let body = Body::dry().named(name).mass(mass);
    body.inertia([0.2, 0.25, 0.3])
        .joint(Joint::Prismatic { axis: AXIS })
}

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// m ẍ = −k (x − x₀) − c ẋ, the armature being part of m.
#[test]
fn a_sprung_slide_swings_and_settles() {
    let passive = Passive::default().stiffness(30.0).rest(0.2).damping(1.5);
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 2e-3;
    scene.add(dry("slide", 2.0).passive(passive.armature(0.7)));
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 1000)).unwrap();
    let rate: f64 = 1.5 / (2.0 * 2.7);
    let frequency = (30.0 / 2.7 - rate * rate).sqrt();
    for s in rollout.samples() {
        let (sin, cos) = (frequency * s.time).sin_cos();
        let x = 0.2 - 0.2 * (-rate * s.time).exp() * (cos + rate / frequency * sin);
        assert!((s.q[0] - x).abs() < 1e-9, "{} for {x}", s.q[0]);
        let energy = 0.5 * 2.7 * s.v[0].powi(2) + 15.0 * (s.q[0] - 0.2).powi(2);
        assert!((s.energy() - energy).abs() < 1e-12);
    }
}

/// With w = √(v² + v_f²), the function w + v_f ln((w − v_f) / v) of the speed falls at the rate τ_f / m.
#[test]
fn friction_stops_a_slide_in_time() {
    let (friction, creep) = (3.0, 0.05);
    let passive = Passive::default().friction(friction).friction_speed(creep);
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 1e-3;
    scene.add(dry("slide", 2.0).passive(passive));
    scene.initial.v = vec![1.0];
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 650)).unwrap();
    let of = |v: f64| {
        let w = v.hypot(creep);
        w + creep * ((w - creep) / v).ln()
    };
    for s in rollout.samples() {
        let exact = of(1.0) - friction / 2.0 * s.time;
        assert!((of(s.v[0]) - exact).abs() < 1e-8, "{} s", s.time);
    }
    assert!(rollout.samples().last().unwrap().v[0] < 0.1);
}

/// F = (m₁ + r² m₂) a.
#[test]
fn a_leader_moves_its_follower_too() {
    let mut scene = Scene::new(Fluid::none());
    scene.add(dry("left", 2.0).actuated());
    scene.add(dry("right", 3.0).mimic(Mimic::new("left").ratio(-0.5).offset(0.1)));
    scene.controller = Some(Controller::Constant { control: vec![1.1] });
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 50)).unwrap();
    for s in rollout.samples() {
        let x = 0.5 * 1.1 / (2.0 + 0.25 * 3.0) * s.time * s.time;
        assert!((s.q[0] - x).abs() < 1e-12 && s.q.len() == 1);
        assert!((s.poses[1].translation.x - (0.1 - 0.5 * x)).abs() < 1e-12);
    }
}

/// An arm of four links with a spring across it in the water, its base free; the claw's joint follows the elbow's with `led`, and has a coordinate of its own without.
fn arm(led: bool, fluid: Fluid) -> Scene {
    let mut scene = Scene::new(fluid);
    scene.gravity = [0.0, 0.0, -9.81];
    let link = |name: &str, x: f64| {
        Body::new(Shape::ellipsoid([0.1, 0.04, 0.03]).faces(80))
            .named(name)
            .density(1200.0)
            .at([x, 0.0, 0.0])
            .shape_at([0.13, 0.0, 0.0], [0.0; 3])
    };
    let hinge = |x, y, z| Joint::Revolute { axis: [x, y, z] };
    scene.add(link("base", 0.0).thruster());
    let damped = Passive::default().damping(0.01).armature(2e-3);
    let elbow = link("elbow", 0.27).child_of("base");
    scene.add(elbow.joint(hinge(0.2, 0.0, 1.0)).actuated().passive(damped));
    let claw = link("claw", 0.27)
        .child_of("elbow")
        .joint(hinge(0.0, 1.0, 0.3));
    let slide = Joint::Prismatic {
        axis: [0.1, 0.2, 1.0],
    };
    let tip = link("tip", 0.3).child_of("claw").joint(slide);
    match led {
        true => {
            scene.add(claw.mimic(Mimic::new("elbow").ratio(-0.8).offset(0.3)));
            scene.add(tip.mimic(Mimic::new("elbow").ratio(0.1)));
        }
        false => {
            scene.add(claw);
            scene.add(tip);
        }
    }
    let spring = Spring::new("base").to("claw", [0.1, 0.0, 0.0]);
    scene.add_force(spring.stiffness(5.0).rest_length(0.2).into());
    scene
}

/// With q = E q' + o of the followers: M' = Eᵀ M E, h' = Eᵀ h.
#[test]
fn followers_are_the_whole_tree_under_a_constraint() {
    let fluids = [
        (Fluid::none(), Fidelity::Isolated),
        (Fluid::fresh_water(), Fidelity::Isolated),
        (Fluid::fresh_water(), Fidelity::Auto),
    ];
    for (fluid, fidelity) in fluids {
        let of = |led| simulator(&arm(led, fluid), fidelity, Integrator::Rk4);
        let (reduced, whole) = (of(true), of(false));
        let mut q = DVector::from_vec(vec![0.1, -0.2, 0.3, 0.8, 0.2, -0.4, 0.4, 0.5]);
        q.rows_mut(3, 4).normalize_mut();
        let v = DVector::from_vec(vec![0.2, -0.3, 0.1, 0.5, -0.4, 0.3, 0.9]);
        let control = DVector::from_vec(vec![0.3, 0.1, -0.2, 0.01, 0.02, 0.05, 0.04]);
        let mut e = DMatrix::identity(9, 7);
        (e[(7, 6)], e[(8, 6)]) = (-0.8, 0.1);
        let all_q = q.push(-0.8 * q[7] + 0.3).push(0.1 * q[7]);
        let all_v = &e * &v;
        let (a, b) = (
            reduced.equations(&q).unwrap(),
            whole.equations(&all_q).unwrap(),
        );
        let close = |x: &DMatrix<f64>, y: &DMatrix<f64>| {
            let error = (x - y).amax() / y.amax();
            assert!(error < 1e-11, "{error:.1e} with {fidelity:?}");
        };
        let [a_mass, b_mass] = [&a, &b].map(|e| e.mass_matrix().unwrap());
        close(a_mass, &(e.transpose() * b_mass * &e));
        let bias = a.bias_force(&v, &control).unwrap();
        let expected = e.transpose() * b.bias_force(&all_v, &control).unwrap();
        close(
            &DMatrix::from_columns(&[bias]),
            &DMatrix::from_columns(&[expected]),
        );
        let point = nalgebra::Vector3::new(0.1, 0.02, 0.0);
        for body in 0..4 {
            let whole = b.point_jacobian(body, &point).unwrap();
            close(&a.point_jacobian(body, &point).unwrap(), &(whole * &e));
        }
        let energy = a.kinetic_energy(&v).unwrap();
        assert!((energy / b.kinetic_energy(&all_v).unwrap() - 1.0).abs() < 1e-12);
    }
}

/// Rollouts of that arm have gradients, and without damping keep their energy.
#[test]
fn transmissions_have_gradients_and_keep_energy() {
    let mut scene = arm(true, Fluid::fresh_water());
    scene.initial.v = vec![0.1, -0.2, 0.1, 0.4, 0.3, -0.2, 0.5];
    for integrator in INTEGRATORS {
        let mut sim = simulator(&scene, Fidelity::Auto, integrator);
        let settings = GradcheckSettings {
            steps: 12,
            directions: 2,
            seed: 3,
            timings: 0,
            enough: Some(1e-6),
        };
        let report = gradcheck(&mut sim, &settings).unwrap();
        assert!(report.max_rel_error < 1e-6, "{integrator:?}: {report:?}");
    }
    scene.bodies[1].passive = Some(Passive::default().stiffness(0.3).armature(2e-3));
    let sim = simulator(&scene, Fidelity::Auto, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 100)).unwrap();
    let energies: Vec<f64> = rollout.samples().iter().map(|s| s.energy()).collect();
    let kinetic = rollout.samples().iter().map(|s| s.kinetic_energy);
    let (first, scale) = (energies[0], kinetic.fold(0.0, f64::max));
    for e in &energies {
        assert!((e - first).abs() < 1e-6 * scale, "{e} for {first}");
    }
}

/// Gains that an explicit drive of 10 ms blows up with (ω Δt of 30, damping beyond 2 / Δt) hold a joint at its target; what they come to is the implicit
/// Euler step of the oscillator.
#[test]
fn stiff_servos_hold_their_target() {
    let mut scene = Scene::new(Fluid::none());
    let gains = Servo::new(2.0 * 3000.0_f64.powi(2), 2.0 * 400.0);
    scene.add(dry("slide", 2.0).actuated().servo(gains));
    let target = 0.3;
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::EnergyEuler,
        Integrator::Midpoint,
    ] {
        let sim = simulator(&scene, Fidelity::Isolated, integrator);
        let controls = Controls::from_matrix(&sim, DMatrix::from_element(1, 100, target)).unwrap();
        let rollout = sim.rollout(&controls).unwrap();
        let last = rollout.samples().last().unwrap();
        let error = last.q[0] - target;
        assert!(error.abs() < 1e-9, "{integrator:?}: {error:.1e}");
        // What the drive does is work, and its control a length.
        assert_eq!(rollout.warnings(), Vec::<String>::new());
        if integrator == Integrator::MomentumEuler {
            let (mut x, mut v, dt) = (0.0, 0.0, 0.01);
            for s in &rollout.samples()[1..] {
                let (k, c) = (gains.stiffness, gains.damping);
                v = (2.0 * v + dt * k * (target - x)) / (2.0 + dt * c + dt * dt * k);
                x += dt * v;
                assert!((s.q[0] - x).abs() < 1e-12, "{} for {x}", s.q[0]);
            }
        }
        let mut sim = sim;
        let settings = GradcheckSettings {
            steps: 10,
            directions: 2,
            seed: 1,
            timings: 0,
            enough: Some(1e-6),
        };
        let report = gradcheck(&mut sim, &settings).unwrap();
        assert!(report.max_rel_error < 1e-6, "{integrator:?}: {report:?}");
    }
}

/// Joints that resist aren't left to an integrator that takes them explicitly, unless it is asked for.
#[test]
fn resisting_joints_get_an_integrator_that_stands_it() {
    let mut scene = Scene::new(Fluid::none());
    scene.add(dry("slide", 2.0).passive(Passive::default().damping(1e6)));
    scene.initial.v = vec![1.0];
    let sim = Simulator::new(&scene, Settings::default()).unwrap();
    let reasons = sim.reasons().join("; ");
    assert!(
        reasons.contains("\"slide\"") && reasons.contains("momentum-euler"),
        "{reasons}"
    );
    let rollout = sim.rollout(&Controls::zeros(&sim, 20)).unwrap();
    assert!(rollout.samples()[20].v[0].abs() < 1e-12);
}

/// What can't be is refused with its name.
#[test]
fn wrong_transmissions_are_refused() {
    let with = |change: &dyn Fn(&mut Scene)| {
        let mut scene = arm(true, Fluid::none());
        change(&mut scene);
        scene.validate().unwrap_err().to_string()
    };
    type Case<'c> = (&'c dyn Fn(&mut Scene), &'c [&'c str]);
    let cases: [Case; 6] = [
        (
            &|s| s.bodies[2].mimic = Some(Mimic::new("claw")),
            &["claw", "follow itself"],
        ),
        (
            &|s| s.bodies[3].mimic = Some(Mimic::new("claw")),
            &["tip", "product of both ratios"],
        ),
        (
            &|s| s.bodies[3].mimic = Some(Mimic::new("base")),
            &["tip", "one coordinate"],
        ),
        (&|s| s.bodies[3].actuated = true, &["tip", "actuated"]),
        (
            &|s| s.bodies[1].passive = Some(Passive::default().damping(-1.0)),
            &["elbow", "passive.damping", "-1", "zero or more"],
        ),
        (
            &|s| s.bodies[0].passive = Some(Passive::default()),
            &["base", "passive", "one coordinate"],
        ),
    ];
    for (change, words) in cases {
        let told = with(change);
        for word in words {
            assert!(told.contains(word), "no {word:?} in: {told}");
        }
    }
}
