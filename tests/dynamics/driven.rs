//! Joints that a motion drives: nobody else says where they are, and no gradient goes there.

use crate::support::{INTEGRATORS, check_gradient, run, says};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Controller, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::{Controls, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_PI_2;

const PHASE: f64 = 0.4;

/// A slider on a rail that swings.
fn swinging(integrator: Integrator) -> Simulator {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    let rail = |axis| Joint::Prismatic { axis };
    let swing = Motion::Sine {
        offset: 0.0,
        amplitude: 0.2,
        frequency: 3.0,
        phase: PHASE,
    };
    scene.add(
        Body::new(Shape::sphere(0.1))
            .named("rail")
            .density(1000.0)
            .joint(Joint::Revolute {
                axis: [0.0, 0.0, 1.0],
            })
            .driven([swing]),
    );
    scene.add(
        Body::new(Shape::sphere(0.1))
            .named("slider")
            .density(1000.0)
            .child_of("rail")
            .at([0.5, 0.0, 0.0])
            .joint(rail([1.0, 0.0, 0.0])),
    );
    scene.time_step = 0.01;
    Simulator::new(&scene, Settings::default().integrator(integrator)).unwrap()
}

#[test]
fn where_a_motion_has_a_joint_no_other_can() {
    let mut simulator = swinging(Integrator::Rk2);
    let at = |t: f64| 0.2 * (3.0 * t + PHASE).sin();
    let q = |angle: f64| DVector::from_vec(vec![angle, 0.02]);
    let v = |rate: f64| DVector::from_vec(vec![rate, 0.1]);
    let error = simulator.set_start(q(0.3), v(0.0)).unwrap_err();
    says(error, &["rail", "0.3", "driven", "0.077"]);
    let error = simulator.state(7, &q(at(0.0)), &v(0.0)).unwrap_err();
    says(error, &["rail", "driven", "t = 0.07 s"]);
    let error = simulator.state(0, &q(0.0), &v(2.0)).unwrap_err();
    says(error, &["initial v", "rail", "got 2"]);
    // What is left to the motion, and what it says, are the same.
    let free = simulator.state(7, &q(0.0), &v(0.0)).unwrap();
    let same = simulator.state(7, &q(at(0.07)), &v(0.0)).unwrap();
    assert!((free.q[0] - at(0.07)).abs() < 1e-15);
    assert!((&free.y - &same.y).amax() < 1e-12);
    let (placed_q, placed_v) = simulator.placed(7, None, Some(&v(0.0))).unwrap();
    assert!((placed_q[0] - at(0.07)).abs() < 1e-15 && placed_q[1] == simulator.start().0[1]);
    assert!((placed_v[0] - 0.6 * (0.21 + PHASE).cos()).abs() < 1e-14 && placed_v[1] == 0.1);
    assert_eq!(
        simulator.state(7, &placed_q, &placed_v).unwrap().q,
        placed_q
    );
    let error = simulator.placed(7, Some(&q(at(0.0))), None).unwrap_err();
    says(error, &["rail", "driven", "t = 0.07 s"]);
    simulator.set_start(q(0.0), v(0.0)).unwrap();
    assert!((simulator.start().0[0] - at(0.0)).abs() < 1e-15);
    assert!((simulator.start().1[0] - 0.6 * PHASE.cos()).abs() < 1e-15);
}

#[test]
fn no_gradient_goes_to_where_a_driven_joint_starts() {
    for integrator in [Integrator::MomentumEuler, Integrator::Rk2, Integrator::Rk4] {
        let simulator = swinging(integrator);
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 5)).unwrap();
        let mut seed = rollout.zero_cotangents();
        seed.q = DMatrix::from_element(2, 6, 1.0);
        seed.v = DMatrix::from_element(2, 6, 0.5);
        let initial = rollout.vjp(&seed).unwrap().initial;
        assert_eq!((initial.q[0], initial.v[0]), (0.0, 0.0));
        assert!(initial.q[1] > 1.0 && initial.v[1] > 0.5, "{initial:?}");
        let state = rollout.jacobians().unwrap().state;
        assert_eq!(state.column(0).amax(), 0.0);
        assert_eq!(state.column(2).amax(), 0.0);
        assert!(state.column(1).amax() > 0.5);
    }
}

/// A cart recoils from what a motion does on it: momentum is kept, whatever the integrator.
#[test]
fn a_driven_joint_pushes_with_all_of_its_acceleration() {
    let mut scene = Scene::new(Fluid::none());
    let axis = [1.0, 0.0, 0.0];
    let body = |name: &str| Body::dry().named(name).mass(1.0).inertia([0.1; 3]);
    scene.add(body("cart").joint(Joint::Prismatic { axis }));
    let swing = Motion::Sine {
        offset: 0.0,
        amplitude: 0.1,
        frequency: 10.0,
        phase: FRAC_PI_2,
    };
    let slider = body("slider").child_of("cart");
    scene.add(slider.joint(Joint::Prismatic { axis }).driven([swing]));
    for (integrator, time_step) in INTEGRATORS
        .into_iter()
        .zip([1e-3, 2e-3].into_iter().cycle())
    {
        scene.time_step = time_step;
        let settings = Settings::default().integrator(integrator);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let rollout = run(&simulator, 100);
        for s in rollout.samples() {
            let exact = 0.5 * (10.0 * s.time).sin();
            assert!(
                (s.v[0] - exact).abs() < 1e-12,
                "{integrator:?} at {} s: {} is not {exact}",
                s.time,
                s.v[0]
            );
        }
    }
    let mut simulator = swinging(Integrator::VelocityEuler);
    check_gradient("a slider on a rail", &mut simulator, 20, 2, 1e-6);
}

/// A joint that is locked has no motion: what is wrong with a velocity there is told as that.
#[test]
fn a_locked_joint_takes_no_velocity() {
    let mut scene = Scene::new(Fluid::none());
    let axis = [1.0, 0.0, 0.0];
    let body = Body::dry().named("lid").mass(1.0).inertia([0.1; 3]);
    scene.add(body.joint(Joint::Prismatic { axis }).locked());
    let mut simulator = Simulator::new(&scene, Settings::default()).unwrap();
    let start = simulator.set_start(DVector::zeros(1), DVector::from_element(1, 0.1));
    says(start.unwrap_err(), &["initial v: lid", "locked", "give 0"]);
}

/// Controls that are played back are those of their times, with steps of any length: a shorter one plays each for as long, a longer one the mean of several.
#[test]
fn playback_keeps_time() {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.02;
    let axis = [1.0, 0.0, 0.0];
    let body = Body::dry().named("cart").mass(2.0).inertia([0.1; 3]);
    scene.add(body.joint(Joint::Prismatic { axis }).actuated());
    let rows: Vec<Vec<f64>> = (0..50).map(|n| vec![(0.3 * f64::from(n)).sin()]).collect();
    // Constant in each step: exact with RK4, whatever part of it a step is.
    let (mut speed, mut place) = (0.0, 0.0);
    for row in &rows {
        place += 0.02 * speed + 0.5 * 0.02 * 0.02 * row[0] / 2.0;
        speed += 0.02 * row[0] / 2.0;
    }
    scene.controller = Some(Controller::Playback { control: rows });
    for parts in [1, 2, 4, 5] {
        let settings = Settings::default()
            .integrator(Integrator::Rk4)
            .time_step(0.02 / parts as f64);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let controls = Controls::zeros(&simulator, 50 * parts);
        let rollout = simulator.rollout(&controls).unwrap();
        let last = rollout.samples().last().unwrap();
        assert!((last.v[0] - speed).abs() < 1e-12, "{parts}: {}", last.v);
        assert!((last.q[0] - place).abs() < 1e-12, "{parts}: {}", last.q);
    }
    // A longer step has the mean of its rows, which may end in one, and of nothing after the last.
    for (time_step, steps) in [(0.04, 25), (0.05, 20), (0.03, 34), (1.0, 1), (1.5, 1)] {
        let settings = Settings::default().time_step(time_step);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let controls = Controls::zeros(&simulator, steps);
        let rollout = simulator.rollout(&controls).unwrap();
        let last = &rollout.samples()[steps].v;
        assert!((last[0] - speed).abs() < 1e-12, "{time_step}: {last}");
    }
}
