//! How much a trajectory magnifies changes of its state: known answers, and differences.

use crate::support;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::simulate::growth::growth;
use hydrograd::{Controls, Fidelity, Simulator};
use nalgebra::{DMatrix, DVector};

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    support::simulator(scene, Fidelity::Isolated, integrator)
}

/// Largest singular value of [1 s; 0 1].
fn drift(s: f64) -> f64 {
    0.5 * (s + (s * s + 4.0).sqrt())
}

/// What a free ball hands on: the displacement plus time times the velocity. Linear in time, without any growth of its own.
#[test]
fn a_free_ball_drifts() {
    for (integrator, density) in [
        (Integrator::MomentumEuler, 0.0),
        (Integrator::Rk2, 0.0),
        (Integrator::Midpoint, 1000.0),
        (Integrator::VelocityEuler, 0.0),
    ] {
        for radius in [0.01, 3.0] {
            let mut scene = Scene::new(Fluid {
                density,
                current: [0.0; 3],
            });
            scene.gravity = [0.0; 3];
            scene.add(Body::new(Shape::sphere(radius)).density(1000.0));
            scene.initial.v = vec![0.3 * radius, -0.1 * radius, 0.2 * radius, 0.0, 0.0, 0.0];
            let steps = 40;
            let found = growth(&simulator(&scene, integrator), steps).unwrap();
            for (n, factor) in found.course.iter().enumerate() {
                let expected = drift(n as f64 / steps as f64);
                assert!(
                    (factor - expected).abs() < 1e-9,
                    "{integrator:?}, state {n}: {factor} is not {expected}"
                );
            }
            assert!((found.total - drift(1.0)).abs() < 1e-9);
            assert!((found.largest_step.factor - drift(1.0 / steps as f64)).abs() < 1e-9);
            assert_eq!(found.peak.step, steps);
            assert!(found.advice().is_none());
        }
    }
}

/// A ball that bounces on top of another one that is fixed; each bounce throws it farther from the top.
fn on_a_curved_floor(aside: f64) -> Simulator {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.time_step = 2e-3;
    scene.contact = Some(Contact {
        stiffness: Some(2e5),
        dissipation: 0.0,
        friction: 0.0,
        ..Contact::default()
    });
    scene.add(
        Body::new(Shape::sphere(0.5))
            .named("floor")
            .density(1000.0)
            .fixed(),
    );
    let rail = |axis| Joint::Prismatic { axis };
    scene.add(
        Body::dry()
            .named("slide")
            .mass(0.01)
            .inertia([1e-4; 3])
            .joint(rail([1.0, 0.0, 0.0])),
    );
    scene.add(
        Body::new(Shape::sphere(0.1))
            .density(1000.0)
            .child_of("slide")
            .at([0.0, 0.0, 0.75])
            .joint(rail([0.0, 0.0, 1.0])),
    );
    scene.initial.q = vec![aside, 0.0];
    simulator(&scene, Integrator::MomentumEuler)
}

/// The scaled Jacobian of the whole trajectory by central differences of its start: coordinates are lengths alone.
fn differences(simulator: &mut Simulator, steps: usize, length: f64) -> f64 {
    let (q, v) = simulator.start();
    let (q, v) = (q.clone(), v.clone());
    let n = v.len();
    let duration = simulator.time_step() * steps as f64;
    let unit = |i: usize| length / if i < n { 1.0 } else { duration };
    let mut out = DMatrix::zeros(2 * n, 2 * n);
    for j in 0..2 * n {
        let h = 1e-7;
        let mut at = |h: f64| {
            let mut change = DVector::zeros(2 * n);
            change[j] = h * unit(j);
            simulator
                .set_start(&q + change.rows(0, n), &v + change.rows(n, n))
                .unwrap();
            let controls = Controls::zeros(simulator, steps);
            let rollout = simulator.rollout(&controls).unwrap();
            let end = &rollout.samples()[steps];
            DVector::from_fn(2 * n, |i, _| {
                (if i < n { end.q[i] } else { end.v[i - n] }) / unit(i)
            })
        };
        let column = (at(h) - at(-h)) / (2.0 * h);
        out.set_column(j, &column);
    }
    simulator.set_start(q, v).unwrap();
    out.singular_values().max()
}

/// The product of the steps' Jacobians is that of the whole, and it grows exponentially with the bounces.
#[test]
fn a_ball_that_bounces_on_a_curved_body_grows_exponentially() {
    let length = (4.0 / 3.0 * std::f64::consts::PI * 0.5_f64.powi(3)).cbrt();
    let mut simulator = on_a_curved_floor(1e-7);
    let mut totals = Vec::new();
    for steps in [150, 300, 450, 600] {
        let found = growth(&simulator, steps).unwrap();
        let expected = differences(&mut simulator, steps, length);
        println!(
            "{steps} steps: {:.4e}, by differences {expected:.4e}",
            found.total
        );
        assert!((found.total / expected - 1.0).abs() < 1e-4);
        totals.push(found.total);
    }
    // Equal times multiply it, where a drift would only add to it.
    let ratios: Vec<f64> = totals.windows(2).map(|w| w[1] / w[0]).collect();
    assert!(ratios.iter().all(|r| *r > 2.0), "{ratios:?}");
    assert!(ratios[2] > ratios[0], "{ratios:?}");
    let found = growth(&simulator, 600).unwrap();
    let said = found.advice().unwrap();
    assert!(
        said.contains("clip") && said.contains("multiple shooting") && said.contains("horizon")
    );
    // The largest single step is one in contact: only there the two balls push.
    let at = found.largest_step.step;
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, 600))
        .unwrap();
    let gap = rollout.samples()[at].poses[2].translation.norm() - 0.6;
    assert!(gap < 0.01, "{gap}");
}

/// A pendulum's start at rest on top: the rate at which it falls over is √(g/l), whatever the integrator.
#[test]
fn a_pendulum_on_its_head_grows_at_its_own_rate() {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.time_step = 1e-3;
    scene.add(
        Body::dry()
            .mass(2.0)
            .inertia([0.0; 3])
            .center_of_mass([0.0, 0.0, 0.5])
            .joint(Joint::Revolute {
                axis: [1.0, 0.0, 0.0],
            }),
    );
    let rate = (9.81_f64 / 0.5).sqrt();
    let simulator = simulator(&scene, Integrator::Rk4);
    let steps = 1000;
    let found = growth(&simulator, steps).unwrap();
    // Angles in radians, velocities in radians per duration T = 1 s: [cosh, sinh/rate; rate sinh, cosh].
    let (c, s) = (rate.cosh(), rate.sinh());
    let exact = nalgebra::Matrix2::new(c, s / rate, rate * s, c);
    let expected = exact.singular_values().max();
    assert!(
        (found.total / expected - 1.0).abs() < 1e-6,
        "{} is not {expected}",
        found.total
    );
}

/// Joints that a motion drives can't be moved by a change of the state, and scenes without free joints don't grow.
#[test]
fn what_is_driven_does_not_grow() {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.add(Body::new(Shape::sphere(0.1)).density(1000.0).fixed());
    let found = growth(&simulator(&scene, Integrator::Rk2), 5).unwrap();
    assert_eq!((found.total, found.course.len()), (1.0, 6));
    assert!(growth(&simulator(&scene, Integrator::Rk2), 0).is_err());

    // A slider on a rail that swings: only the slider's own coordinate counts. It is carried along, but drifts as if it weren't.
    let rail = |axis| Joint::Prismatic { axis };
    let swing = Motion::Sine {
        offset: 0.0,
        amplitude: 0.2,
        frequency: 3.0,
        phase: 0.4,
    };
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.add(
        Body::new(Shape::sphere(0.1))
            .named("rail")
            .density(1000.0)
            .joint(rail([0.0, 1.0, 0.0]))
            .driven([swing]),
    );
    scene.add(
        Body::new(Shape::sphere(0.1))
            .density(1000.0)
            .child_of("rail")
            .at([0.0, 0.0, 0.5])
            .joint(rail([1.0, 0.0, 0.0])),
    );
    for integrator in [Integrator::MomentumEuler, Integrator::Rk2] {
        let found = growth(&simulator(&scene, integrator), 30).unwrap();
        assert!((found.total - drift(1.0)).abs() < 1e-9, "{}", found.total);
    }
}
