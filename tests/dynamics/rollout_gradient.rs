//! Gradients of whole rollouts against central differences: every integrator, every fidelity,
//! every kind of joint.

use crate::support::forward::{self, check_forward};
use crate::support::{INTEGRATORS, example};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, BodyId, Drag, Fluid, Joint, Passive, Plane, Scene, Shape};
use hydrograd::simulate::Sample;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DVector;

const FIDELITIES: [Fidelity; 4] = [
    Fidelity::Isolated,
    Fidelity::Reduced,
    Fidelity::Auto,
    Fidelity::Full,
];

fn check(scene: &Scene, fidelity: Fidelity, integrator: Integrator, steps: usize, faces: usize) {
    // Long rollouts along one direction of each group, short ones along two.
    let directions = if steps > 20 { 1 } else { 2 };
    // Derivatives are exact at any resolution.
    let faces = if fidelity == Fidelity::Full {
        faces.min(40)
    } else {
        faces
    };
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(integrator)
        .tolerance(1e-13)
        .faces(faces);
    let mut simulator = Simulator::new(scene, settings).unwrap();
    let report = gradcheck(
        &mut simulator,
        &gradcheck::GradcheckSettings {
            steps,
            directions,
            seed: 7,
            timings: 0,
            enough: Some(1e-6),
        },
    )
    .unwrap();
    println!(
        "{} {fidelity:?} {integrator:?} {steps}: {:.1e}",
        scene.name, report.max_rel_error
    );
    let what = format!("{} {fidelity:?} {integrator:?}", scene.name);
    check_forward(&what, &simulator, steps.min(20), forward::LIMIT);
    assert!(
        report.max_rel_error <= 1e-6,
        "{} {fidelity:?} {integrator:?}: {:#?}",
        scene.name,
        report.directions
    );
}

/// Differences about rest are off by their own step where drag is |v| v: the check goes on to shorter ones, and passes.
#[test]
fn a_start_at_rest_with_drag_passes() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let drag = Drag {
        quadratic: 1.0,
        ..Drag::default()
    };
    scene.add(
        Body::new(Shape::sphere(0.1).faces(320))
            .density(998.2)
            .drag(drag),
    );
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .time_step(0.02);
    let mut simulator = Simulator::new(&scene, settings).unwrap();
    let settings = gradcheck::GradcheckSettings {
        steps: 10,
        directions: 2,
        seed: 1,
        timings: 0,
        enough: None,
    };
    let report = gradcheck(&mut simulator, &settings).unwrap();
    let at_rest = (report.directions.iter()).filter(|d| d.group == "initial");
    for direction in at_rest {
        let errors = &direction.rel_errors;
        println!("{errors:?}");
        assert!(errors[3] > 1e-7, "{errors:?}");
        assert!((7.0..13.0).contains(&(errors[2] / errors[3])), "{errors:?}");
    }
    assert!(report.max_rel_error < 1e-7, "{report:?}");
}

#[test]
fn kirchhoff_ellipsoid() {
    for integrator in INTEGRATORS {
        for fidelity in FIDELITIES {
            check(
                &example("kirchhoff_ellipsoid"),
                fidelity,
                integrator,
                10,
                80,
            );
        }
    }
}

#[test]
fn coins() {
    for integrator in INTEGRATORS {
        for fidelity in FIDELITIES {
            check(&example("coins"), fidelity, integrator, 4, 80);
        }
    }
}

/// Two bodies near each other over a wall, in a current, one with an added mass of its own.
#[test]
fn a_given_added_mass() {
    let mut scene = Scene::new(Fluid {
        current: [0.1, -0.2, 0.0],
        ..Fluid::fresh_water()
    });
    scene.add_wall([0.0, 0.0, -0.15], [0.0, 0.0, 1.0]);
    let rows = std::array::from_fn(|i| {
        std::array::from_fn(|j: usize| {
            let arm = |i: usize| if i < 3 { 1.0 } else { 0.1 };
            let aside = 0.1 * (1.0 + i.min(j) as f64 + 2.0 * i.max(j) as f64).sin();
            let own = if i == j { 1.0 + 0.1 * i as f64 } else { aside };
            4e-3 * own * arm(i) * arm(j)
        })
    });
    let egg = Body::new(Shape::ellipsoid([0.12, 0.08, 0.1])).density(1100.0);
    scene.add(egg.rotated([0.2, -0.4, 0.3]).added_mass(rows));
    let brick = Body::new(Shape::cuboid([0.2, 0.15, 0.18])).density(900.0);
    scene.add(brick.at([0.1, 0.05, 0.29]));
    scene.initial.v = (0..12).map(|i| (1.0 + 2.0 * f64::from(i)).sin()).collect();
    scene.time_step = 0.005;
    for integrator in INTEGRATORS {
        check(&scene, Fidelity::Reduced, integrator, 4, 80);
    }
    check(&scene, Fidelity::Auto, Integrator::MomentumEuler, 4, 80);
    check(&scene, Fidelity::Full, Integrator::MomentumEuler, 4, 40);
}

#[test]
fn falling_ball() {
    for integrator in INTEGRATORS {
        for fidelity in FIDELITIES {
            // What `auto` steps with here is `reduced`; every integrator has it in `a_pair_that_comes_and_goes`.
            if fidelity != Fidelity::Auto || integrator == Integrator::MomentumEuler {
                check(&example("falling_ball"), fidelity, integrator, 5, 80);
            }
        }
    }
}

#[test]
fn falling_ball_for_many_steps() {
    for integrator in INTEGRATORS {
        for fidelity in FIDELITIES {
            // What `auto` steps with here is `reduced`; `full` takes minutes with integrators that evaluate it often. What an integrator
            // makes of many steps doesn't depend on the coupling: of a coupled pair every integrator but the default takes fewer.
            let steps = match (fidelity, integrator) {
                (Fidelity::Auto, _) => continue,
                (Fidelity::Full, Integrator::MomentumEuler) => 20,
                (Fidelity::Full, _) => continue,
                (Fidelity::Reduced, Integrator::MomentumEuler) | (Fidelity::Isolated, _) => 100,
                _ => 25,
            };
            check(&example("falling_ball"), fidelity, integrator, steps, 20);
        }
    }
}

/// A pair that comes into the range where it is coupled and leaves it again: state, energy and
/// gradient go on smoothly.
#[test]
fn a_pair_that_comes_and_goes() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = |x: f64, y: f64| {
        Body::new(Shape::sphere(0.1))
            .density(1200.0)
            .at([x, y, 0.0])
            .joint(Joint::Planar { plane: Plane::Xy })
    };
    scene.add(ball(0.0, 0.0).named("near"));
    scene.add(ball(1.3, 0.28).named("far"));
    scene.initial.v = vec![1.0, 0.0, 0.0, -1.0, 0.0, 0.0];
    scene.time_step = 0.005;
    let settings = Settings::default()
        .fidelity(Fidelity::Auto)
        .integrator(Integrator::Rk4)
        .accuracy(0.03);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let reasons = simulator.reasons().join("; ");
    assert!(reasons.contains("not at all from"), "{reasons}");
    let steps = 260;
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, steps))
        .unwrap();
    let energies: Vec<f64> = rollout.samples().iter().map(|s| s.energy()).collect();
    let distance = |s: &Sample| (s.poses[0].translation - s.poses[1].translation).norm();
    let distances: Vec<f64> = rollout.samples().iter().map(distance).collect();
    let (first, last) = (distances[0], distances[steps]);
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    println!("{reasons}\n{first} {nearest} {last}");
    // Through the whole fading range, both ways.
    assert!(first > 0.9 && nearest < 0.4 && last > 0.9);
    for (n, e) in energies.iter().enumerate() {
        let error = (e / energies[0] - 1.0).abs();
        assert!(error < 1e-7, "step {n}: energy off by {error:e}");
    }
    check(&scene, Fidelity::Auto, Integrator::Rk2, steps, 320);
    for integrator in INTEGRATORS {
        check(&scene, Fidelity::Auto, integrator, 80, 320);
    }
}

/// Springs that turn by more than a radian in a step: where the midpoint gets there its reverse sweep does.
#[test]
fn stiff_springs_have_gradients_by_the_midpoint() {
    let axis = [1.0, 0.0, 0.0];
    for turns in [&[1.3][..], &[1.5], &[1.6], &[0.2, 1.2, 1.5]] {
        let mut scene = Scene::new(Fluid::none());
        scene.time_step = 0.01;
        for (k, turn) in turns.iter().enumerate() {
            let body = Body::dry().named(format!("mass {k}")).mass(1.0);
            let mut body = body.inertia([0.1; 3]).joint(Joint::Prismatic { axis });
            let stiffness = (turn / scene.time_step).powi(2);
            body.passive = Some(Passive::default().stiffness(stiffness));
            scene.add(body);
            scene.initial.q.push(0.1);
        }
        let settings = Settings::default().integrator(Integrator::Midpoint);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let controls = Controls::zeros(&simulator, 40);
        let rollout = simulator.rollout(&controls).unwrap();
        let mut seed = rollout.zero_cotangents();
        seed.q.column_mut(40).fill(1.0);
        let found = rollout.vjp(&seed).unwrap().initial;
        // A step turns q and v/ω by 2 atan(½ωΔt).
        let (last, whole) = (&rollout.samples()[40].q, rollout.summary().cut_steps == 0);
        for (k, turn) in turns.iter().enumerate() {
            // Linear in where they start.
            assert!(
                (found.q[k] - last[k] / 0.1).abs() < 1e-9,
                "{turns:?}: {found:?}"
            );
            if !whole {
                continue;
            }
            let angle = 40.0 * 2.0 * (0.5 * turn).atan();
            let omega = turn / scene.time_step;
            let [by_q, by_v] = [angle.cos(), angle.sin() / omega];
            assert!((found.q[k] - by_q).abs() < 1e-9, "{turns:?}: {found:?}");
            assert!(
                (found.v[k] - by_v).abs() * omega < 1e-9,
                "{turns:?}: {found:?}"
            );
        }
        check_forward("stiff springs", &simulator, 5, forward::LIMIT);
    }
}

/// Objectives that don't fit the scene are refused by name, and those that do agree with differences.
#[test]
fn objectives_are_checked_and_differentiated() {
    let settings = Settings::default().faces(80).tolerance(1e-13);
    let mut simulator = Simulator::new(&example("coins"), settings).unwrap();
    let controls = Controls::zeros(&simulator, 5);
    let body = BodyId(1);
    let goal = objective::final_position(body, [0.1, 0.0, 0.2])
        + objective::mean_position(body, [0.0, 0.1, 0.0])
        + objective::final_coordinate(2, 0.3, 1e-3)
        + objective::final_velocity(5, 0.1, 1e-3);
    let gradient = simulator
        .rollout(&controls)
        .unwrap()
        .gradient(&goal)
        .unwrap();
    let (q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
    let d = DVector::from_fn(6, |i, _| (i as f64 + 1.0).sin() * 1e-2);
    let mut at = |h: f64| {
        simulator.set_start(&q + h * &d, v.clone()).unwrap();
        simulator.rollout(&controls).unwrap().value(&goal).unwrap()
    };
    let difference = (8.0 * (at(0.1) - at(-0.1)) - (at(0.2) - at(-0.2))) / 1.2;
    let adjoint = gradient.initial.q.dot(&d);
    assert!(
        (difference - adjoint).abs() < 1e-7 * adjoint.abs(),
        "{difference} {adjoint}"
    );
    let rollout = simulator.rollout(&controls).unwrap();
    let wrong = [
        (objective::final_position(BodyId(7), [0.0; 3]), "body"),
        (objective::final_velocity(6, 0.0, 1.0), "velocity"),
        (objective::final_coordinate(9, 0.0, 1.0), "coordinate"),
        (objective::effort(f64::NAN), "finite"),
    ];
    for (objective, word) in wrong {
        let message = rollout.gradient(&objective).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
        assert!(rollout.value(&objective).is_err());
    }
}
