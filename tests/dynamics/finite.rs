//! What leaves floating point is an error that names its step and its coordinate, forwards and back.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::{Controls, Error, Fidelity, Settings, Simulator};

fn sphere(density: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density,
        current: [0.0; 3],
    });
    scene.add(Body::new(Shape::sphere(0.1)).named("ball").density(1000.0));
    scene.time_step = 0.01;
    scene
}

fn run(scene: &Scene, integrator: Integrator, steps: usize) -> Result<(), Error> {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(integrator);
    let simulator = Simulator::new(scene, settings)?;
    let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
    let last = &rollout.samples()[steps];
    assert!(last.energy().is_finite() && last.v.iter().all(|x| x.is_finite()));
    let summary = rollout.summary();
    assert!(summary.energy_final.is_finite() && summary.momentum_drift.is_none_or(f64::is_finite));
    let mut seed = rollout.zero_cotangents();
    seed.q.fill(1.0);
    seed.v.fill(1.0);
    let gradient = rollout.vjp(&seed)?;
    let all = gradient.initial.q.iter().chain(gradient.initial.v.iter());
    assert!(
        all.chain(&gradient.parameters.to_vec())
            .all(|x| x.is_finite())
    );
    Ok(())
}

#[test]
fn motions_beyond_floating_point_are_errors() {
    let motion = |amplitude, frequency| Motion::Sine {
        offset: 0.0,
        amplitude,
        frequency,
        phase: 0.3,
    };
    for (amplitude, frequency) in [(1e300, 1.0), (1e300, 1e300), (1.0, 1e300), (1e200, 1.0)] {
        for density in [0.0, 1000.0] {
            let mut scene = sphere(density);
            let axis = [1.0, 0.0, 0.0];
            scene.bodies[0].joint = Joint::Prismatic { axis };
            scene.bodies[0].motion = Some(vec![motion(amplitude, frequency)]);
            let error = run(&scene, Integrator::Rk2, 3).unwrap_err();
            says(&error, &["step ", "ball"]);
        }
    }
}

#[test]
fn a_run_that_blows_up_names_its_step_and_what_ran_away() {
    for integrator in [Integrator::Rk2, Integrator::Rk4] {
        let mut scene = sphere(1000.0);
        scene.bodies[0].drag = Some(Drag {
            quadratic: 1e3,
            ..Drag::default()
        });
        scene.time_step = 1.0;
        scene.initial.v = vec![30.0, 1.0, 0.0, 0.0, 0.0, 2.0];
        let error = run(&scene, integrator, 60).unwrap_err();
        println!("{integrator:?}: {error}");
        says(&error, &["step ", "ball"]);
        assert!(!error.to_string().contains("must be positive definite"));
    }
}
