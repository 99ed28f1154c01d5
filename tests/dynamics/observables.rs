//! Observables by name: what they read, what they seed, and what is refused.

use crate::support::says;
use hydrograd::optimize::{Cost, Guess, IlqrProgress, IlqrSettings, Problem, ilqr, terms};
use hydrograd::scene::{Body, BodyId, Contact, Fluid, Scene, Site};
use hydrograd::simulate::observable::OBSERVABLES;
use hydrograd::simulate::{Checkpoints, Objective, Partwise, Recording, Rollout};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DMatrix;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A dry body that tumbles without any force.
fn tumbling() -> (Scene, Rollout) {
    let mut scene = Scene::new(Fluid::none());
    let body = Body::dry()
        .named("plate")
        .mass(2.0)
        .inertia([0.1, 0.2, 0.28]);
    scene.add(body.center_of_mass([0.1, 0.0, 0.05]));
    scene.initial.v = vec![0.3, -0.1, 0.2, 1.0, 2.0, -0.5];
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .time_step(1e-3);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, 200))
        .unwrap();
    (scene, rollout)
}

#[test]
fn angular_momentum_about_the_centre_of_mass_is_kept_without_a_moment() {
    let (_, rollout) = tumbling();
    let all = rollout.observe("angular_momentum").unwrap();
    assert_eq!(all.shape(), (3, 201));
    let first = all.column(0).into_owned();
    // Body axes are the world's at the start.
    let exact = [0.1 * 1.0, 0.2 * 2.0, -0.28 * 0.5];
    for k in 0..3 {
        assert!((first[k] - exact[k]).abs() < 1e-14);
    }
    for n in 0..201 {
        assert!((all.column(n) - &first).norm() < 1e-6 * first.norm());
    }
}

#[test]
fn every_observable_has_a_label_and_a_value_for_every_entry() {
    let (scene, rollout) = tumbling();
    for o in OBSERVABLES {
        let rows: usize = o.shape(rollout.simulator().system()).iter().product();
        assert_eq!(o.labels(&scene).len(), rows, "{}", o.name());
        assert_eq!(rollout.observe(o.name()).unwrap().shape(), (rows, 201));
        assert!(!o.unit().is_empty());
    }
    let all = Recording::with(&scene, &rollout, OBSERVABLES.iter().copied()).unwrap();
    let columns: Vec<&str> = all.columns().map(|(name, _, _)| name).collect();
    for name in [
        "plate.qw",
        "energy",
        "plate.position_x",
        "plate.angular_momentum_z",
    ] {
        assert_eq!(columns.iter().filter(|c| **c == name).count(), 1, "{name}");
    }
    // One key for each thing in the file, also where an observable has the name of the labels of another.
    let text = serde_json::to_string(&all).unwrap();
    let values: serde_json::Value = serde_json::from_str(&text).unwrap();
    for key in [
        "coordinates",
        "velocities",
        "velocities_labels",
        "v",
        "time",
    ] {
        assert_eq!(text.matches(&format!("\"{key}\":")).count(), 1, "{key}");
    }
    assert_eq!(values["velocities_labels"].as_array().unwrap().len(), 6);
    assert_eq!(values["velocities"].as_array().unwrap().len(), 201);
}

#[test]
fn cotangents_by_name_are_those_of_the_fields() {
    let (_, rollout) = tumbling();
    let mut fields = rollout.zero_cotangents();
    let mut named = rollout.zero_cotangents();
    for (i, x) in fields.positions.iter_mut().enumerate() {
        *x = (0.37 * i as f64).sin();
    }
    fields.rotations.fill(0.2);
    fields.v.fill(-0.3);
    fields.q.fill(0.1);
    for (name, x) in [
        ("positions", &fields.positions),
        ("rotations", &fields.rotations),
        ("v", &fields.v),
        ("q", &fields.q),
    ] {
        named.observables.insert(name.into(), x.clone());
    }
    let (a, b) = (rollout.vjp(&fields).unwrap(), rollout.vjp(&named).unwrap());
    assert!((&a.initial.q - &b.initial.q).norm() <= 1e-14 * a.initial.q.norm());
    assert!((&a.initial.v - &b.initial.v).norm() <= 1e-14 * a.initial.v.norm());

    let last = rollout.samples().last().unwrap().poses[0].translation;
    let whole = objective::final_position(BodyId(0), [0.0; 3]);
    let parts = (0..3).map(|k| objective::final_observable("positions", k, 0.0, 1.0));
    let parts = parts.reduce(|a, b| a + b).unwrap();
    assert!((rollout.value(&parts).unwrap() - last.norm_squared()).abs() < 1e-14);
    let (a, b) = (
        rollout.gradient(&whole).unwrap(),
        rollout.gradient(&parts).unwrap(),
    );
    assert!((&a.initial.v - &b.initial.v).norm() <= 1e-13 * a.initial.v.norm());
}

#[test]
fn what_has_no_derivatives_or_no_name_is_refused() {
    let (_, rollout) = tumbling();
    let error = rollout.observe("enery").unwrap_err();
    says(&error, &["\"enery\"", "angular_momentum"]);
    let mut seed = rollout.zero_cotangents();
    seed.observables
        .insert("energy".into(), DMatrix::zeros(1, 201));
    says(
        rollout.vjp(&seed).unwrap_err(),
        &["derivative", "energy", "has none", "angular_momentum"],
    );
    let mut seed = rollout.zero_cotangents();
    seed.observables
        .insert("angular_momentum".into(), DMatrix::zeros(3, 200));
    says(
        rollout.vjp(&seed).unwrap_err(),
        &["angular_momentum", "(3, 201)"],
    );
    let goal = objective::final_observable("rotations", 0, 0.0, 1.0);
    says(
        rollout.value(&goal).unwrap_err(),
        &["rotations", "independent"],
    );
    let goal = objective::final_observable("angular_momentum", 3, 0.0, 1.0);
    says(rollout.value(&goal).unwrap_err(), &["entry", "under 3"]);
}

/// What a body with a site on it does that falls, is pushed and lands.
fn landing() -> Rollout {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene.contact = Some(Contact::default());
    let body = Body::new(hydrograd::Shape::cuboid([0.2, 0.15, 0.1]).faces(80));
    let body = body.named("block").density(2500.0).thruster();
    scene.add(body.at([0.0, 0.0, 0.07]).rotated([0.2, 0.1, 0.3]));
    scene.add_site(Site::new("nose", "block").at([0.1, 0.02, -0.03]));
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings.time_step(2e-3)).unwrap();
    let controls = DMatrix::from_fn(6, 40, |i, n| (0.3 * (i + n) as f64).sin());
    let controls = Controls::from_matrix(&simulator, controls).unwrap();
    simulator.rollout(&controls).unwrap()
}

#[test]
fn accelerations_are_what_velocities_gain_contact_and_all() {
    let rollout = landing();
    let dt = rollout.simulator().time_step();
    for (gain, of) in [
        ("accelerations", "velocities"),
        ("site_accelerations", "site_velocities"),
    ] {
        let (a, v) = (rollout.observe(gain).unwrap(), rollout.observe(of).unwrap());
        for n in 0..=40 {
            let first = n.min(39);
            let mean = (v.column(first + 1) - v.column(first)) / dt;
            assert!((a.column(n) - &mean).norm() <= 1e-12 * mean.norm());
        }
        // The floor pushes back harder than anything else does.
        assert!(a.row(2).max() > 20.0, "{gain}: {}", a.row(2).max());
    }
}

/// Against the accelerations that the equations of motion give: the mean over a step is that in its middle, to second order.
#[test]
fn accelerations_are_those_of_the_equations_of_motion() {
    let (_, rollout) = tumbling();
    let means = rollout.observe("accelerations").unwrap();
    let none = nalgebra::DVector::zeros(6);
    let exact = |n: usize| {
        let sample = &rollout.samples()[n];
        let equations = rollout.simulator().equations(&sample.q).unwrap();
        let control = nalgebra::DVector::zeros(0);
        let rates = equations.acceleration(&sample.v, &control, &none, &none);
        let origin = nalgebra::Vector3::zeros();
        equations
            .point_acceleration(&sample.v, &rates.unwrap(), 0, &origin)
            .unwrap()
    };
    for n in [0, 60, 150] {
        let middle = 0.5 * (exact(n) + exact(n + 1));
        let off = (means.column(n) - middle).norm() / middle.norm();
        assert!(off < 1e-5, "{off}");
    }
}

/// Both derivatives of both kinds, through contact; and what reads one state alone refuses them.
#[test]
fn accelerations_have_derivatives() {
    let rollout = landing();
    for name in ["accelerations", "site_accelerations"] {
        let mut bars = rollout.zero_cotangents();
        let bar = DMatrix::from_fn(6, 41, |i, n| (0.7 * i as f64 + 0.31 * n as f64).cos());
        bars.observables.insert(name.into(), bar.clone());
        let gradient = rollout.vjp(&bars).unwrap();
        let mut along = rollout.zero_displacement();
        along.controls.fill(0.4);
        along.initial.v.fill(0.2);
        along.initial.q.fill(0.1);
        let first = along.clone();
        let tangents = &rollout.jvp(&[along.clone()], &[name]).unwrap()[0];
        let once = tangents.observables[name].clone();
        let forward = tangents.observables[name].dot(&bar);
        let reverse = gradient.controls.dot(&along.controls)
            + gradient.initial.v.dot(&along.initial.v)
            + gradient.initial.q.dot(&along.initial.q);
        assert!((forward - reverse).abs() < 1e-9 * forward.abs());

        let variables = hydrograd::simulate::Variables {
            initial_v: true,
            ..Default::default()
        };
        let states = [3, 39, 40];
        let jacobian = &rollout.jacobian(&variables, &[name], &states).unwrap()[0];
        let mut along = rollout.zero_displacement();
        along.initial.v.fill(1.0);
        let tangents = &rollout.jvp(&[along], &[name]).unwrap()[0].observables[name];
        for (k, n) in states.into_iter().enumerate() {
            let sums = jacobian.rows(6 * k, 6).column_sum();
            assert!((sums - tangents.column(n)).norm() < 1e-9 * tangents.norm());
        }
        says(
            rollout.observable_jacobian(name, 3).unwrap_err(),
            &[name, "two states", "Rollout::jacobian"],
        );
        let simulator = rollout.simulator();
        let still = simulator.rollout(&Controls::zeros(simulator, 0)).unwrap();
        says(still.observe(name).unwrap_err(), &[name, "without steps"]);
        let goal = objective::final_observable(name, 2, 0.0, 1.0);
        says(still.value(&goal).unwrap_err(), &[name, "without steps"]);
        let twice = &rollout.jvp(&[first], &[name, name]).unwrap()[0];
        assert_eq!(twice.observables[name], once);
        let goal = objective::final_observable(name, 2, 0.0, 1.0);
        assert!(rollout.gradient(&goal).unwrap().controls.norm() > 0.0);
        let controls = Controls::zeros(simulator, 40);
        let in_parts = |goal: &dyn Partwise| {
            let go_on = |_| ControlFlow::Continue(());
            simulator.gradient_in_parts(&controls, goal, Checkpoints::new(40), go_on)
        };
        let whole = simulator.rollout(&controls).unwrap();
        let whole = whole.gradient(&goal).unwrap().controls;
        let parts = in_parts(&goal).unwrap().gradient.controls;
        assert!((parts - &whole).norm() < 1e-12 * whole.norm());
        let always = objective::mean_observable(name, 2, 0.0, 1.0);
        let mean = rollout.observe(name).unwrap().row(2).norm_squared() / 41.0;
        assert!((rollout.value(&always).unwrap() - mean).abs() < 1e-12 * mean);
        says(
            in_parts(&always).map(drop).unwrap_err(),
            &[name, "in parts", "whole rollout"],
        );
    }
}

/// Attitudes miss what they are to be by the shorter way round, in objectives and in costs of optimal control.
#[test]
fn attitudes_miss_by_the_shorter_way_round() {
    let mut scene = Scene::new(Fluid::none());
    let body = Body::dry().mass(2.0).inertia([0.1, 0.2, 0.28]).thruster();
    scene.add(body.rotated([0.0, 0.0, -3.1]));
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
    let miss = TAU - 6.2;
    let goal = objective::final_observable("attitudes", 2, 3.1, 1.0);
    let cost = goal.value(&rollout);
    assert!((cost - miss * miss).abs() < 1e-12, "{cost}");
    let turned = rollout.gradient(&goal).unwrap().initial.q[5];
    assert!((turned - 2.0 * miss).abs() < 1e-9, "{turned}");
    let cost = Cost::default().last(terms::observable("attitudes", [2], [3.1], 1.0));
    let problem = Problem::new(2, cost);
    let start = simulator.initial().unwrap();
    let settings = IlqrSettings {
        iterations: 1,
        ..IlqrSettings::default()
    };
    let on = |_: &IlqrProgress| ControlFlow::Continue(());
    let plan = ilqr(&simulator, &start, &problem, Guess::Zero, &settings, on).unwrap();
    let first = plan.costs[0];
    assert!((first - miss * miss).abs() < 1e-12, "{first}");
}
