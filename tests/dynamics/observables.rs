//! Observables by name: what they read, what they seed, and what is refused.

use crate::support::says;
use hydrograd::scene::{Body, BodyId, Fluid, Scene};
use hydrograd::simulate::observable::OBSERVABLES;
use hydrograd::simulate::{Recording, Rollout};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::DMatrix;

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
