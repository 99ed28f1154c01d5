//! Runs from any state and runs that are ended early; the Jacobians and velocities of a rollout; meshes number by number.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::{Body, Controls, Error, Fidelity, Fluid, Joint, Scene, Settings, Shape, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// A driven ball on a rail beside a free coin.
fn simulator(settings: Settings) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    let rail = Joint::Prismatic {
        axis: [1.0, 0.0, 0.0],
    };
    let ball = Body::new(Shape::sphere(0.05)).density(1200.0);
    scene.add(ball.at([-0.12, 0.0, 0.01]).joint(rail).actuated());
    scene.add(Body::new(Shape::ellipsoid([0.01, 0.04, 0.04])).density(998.0));
    Simulator::new(&scene, settings.time_step(0.02).faces(80)).unwrap()
}

fn push(simulator: &Simulator, steps: usize) -> Controls {
    let matrix = DMatrix::from_fn(1, steps, |_, n| 0.5 - 0.2 * n as f64);
    Controls::from_matrix(simulator, matrix).unwrap()
}

fn go_on(_: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_run_goes_on_to_the_bit() {
    let sim = simulator(Settings::default());
    let all = push(&sim, 6);
    let whole = sim.rollout(&all).unwrap();
    let rest = Controls::from_matrix(&sim, all.matrix().columns(2, 4).into_owned()).unwrap();
    let second = sim.rollout_from(&whole.states()[2], &rest, go_on).unwrap();
    assert_eq!(second.states(), &whole.states()[2..]);
    assert_eq!(second.v(), whole.v().columns(2, 5));
    assert_eq!(second.samples()[0].time, whole.samples()[2].time);

    // The whole gradient, once in one sweep and once through the state in between.
    let mut seed = second.zero_cotangents();
    seed.positions[(3, 4)] = 1.0;
    let late = second.vjp(&seed).unwrap();
    let half = Controls::from_matrix(&sim, all.matrix().columns(0, 2).into_owned()).unwrap();
    let first = sim.rollout(&half).unwrap();
    let mut seed = first.zero_cotangents();
    seed.q.set_column(2, &late.initial.q);
    seed.v.set_column(2, &late.initial.v);
    let early = first.vjp(&seed).unwrap();
    let mut seed = whole.zero_cotangents();
    seed.positions[(3, 6)] = 1.0;
    let once = whole.vjp(&seed).unwrap();
    let scale = once.controls.norm();
    assert!((once.controls.columns(0, 2) - &early.controls).norm() < 1e-9 * scale);
    assert!((once.controls.columns(2, 4) - &late.controls).norm() < 1e-9 * scale);
    let scale = once.initial.v.norm();
    assert!((&once.initial.v - &early.initial.v).norm() < 1e-9 * scale);
}

#[test]
fn a_state_of_coordinates_and_velocity_is_where_a_run_begins() {
    let mut sim = simulator(Settings::default());
    let (q, _) = sim.start();
    let (q, v) = (q.clone(), DVector::from_fn(7, |i, _| 0.01 * i as f64));
    let state = sim.state(0, &q, &v).unwrap();
    let none = Controls::zeros(&sim, 2);
    let found = sim.rollout_from(&state, &none, go_on).unwrap().q();
    let late = sim.state(5, &q, &v).unwrap();
    let times = sim.rollout_from(&late, &none, go_on).unwrap();
    assert!((times.samples()[0].time - 0.1).abs() < 1e-15);
    let message = sim.state(0, &v, &q).unwrap_err().to_string();
    assert!(message.contains("initial q"), "{message}");
    let mut wrong = state.clone();
    wrong.y = DVector::zeros(3);
    let error = sim.rollout_from(&wrong, &none, go_on).err().unwrap();
    assert!(error.to_string().contains("[8, 3]"), "{error}");
    sim.set_start(q, v).unwrap();
    assert_eq!(found, sim.rollout(&none).unwrap().q());
}

#[test]
fn runs_and_sweeps_end_when_told() {
    let sim = simulator(Settings::default().fidelity(Fidelity::Isolated));
    let stop = |at: usize| {
        move |n: usize| match n < at {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    };
    let start = sim.initial().unwrap();
    let controls = Controls::zeros(&sim, 9);
    let ended = sim.rollout_from(&start, &controls, stop(3)).err().unwrap();
    assert!(matches!(ended, Error::Stopped { .. }));
    assert!(ended.to_string().contains("after 3 of 9 steps"), "{ended}");
    let rollout = sim.rollout(&controls).unwrap();
    let ended = rollout.vjp_with(&rollout.zero_cotangents(), stop(4));
    let ended = ended.unwrap_err().to_string();
    assert!(ended.contains("4 of 9 steps back"), "{ended}");
}

#[test]
fn clones_share_what_was_prepared_and_nothing_else() {
    let sim = simulator(Settings::default());
    let mut other = sim.clone();
    let mut parameters = sim.parameters().clone();
    *parameters.mass_mut(0) *= 2.0;
    other.set_parameters(parameters).unwrap();
    let controls = push(&sim, 3);
    let (one, two) = (
        sim.rollout(&controls).unwrap(),
        other.rollout(&controls).unwrap(),
    );
    assert_ne!(one.q(), two.q());
    assert_eq!(
        one.q(),
        simulator(Settings::default())
            .rollout(&controls)
            .unwrap()
            .q()
    );
}

#[test]
fn jacobians_are_slopes() {
    let sim = simulator(Settings::default().tolerance(1e-12));
    let (q, v) = (sim.start().0.clone(), DVector::from_element(7, 0.05));
    let controls = push(&sim, 2);
    let run = |v: &DVector<f64>, u: &DMatrix<f64>| {
        let controls = Controls::from_matrix(&sim, u.clone()).unwrap();
        let state = sim.state(0, &q, v).unwrap();
        sim.rollout_from(&state, &controls, go_on)
            .unwrap()
            .v()
            .column(2)
            .into_owned()
    };
    let state = sim.state(0, &q, &v).unwrap();
    let made = sim
        .rollout_from(&state, &controls, go_on)
        .unwrap()
        .jacobians()
        .unwrap();
    assert_eq!(made.state.shape(), (14, 14));
    assert_eq!(made.controls.shape(), (14, 2));
    let h = 1e-4;
    for i in 0..7 {
        let mut step = DVector::zeros(7);
        step[i] = h;
        let slope = (run(&(&v + &step), controls.matrix()) - run(&(&v - &step), controls.matrix()))
            / (2.0 * h);
        let found = made.state.view((7, 7 + i), (7, 1)).into_owned();
        assert!((&found - &slope).norm() < 1e-6, "{found} {slope}");
    }
    for n in 0..2 {
        let mut step = DMatrix::zeros(1, 2);
        step[n] = h;
        let slope = (run(&v, &(controls.matrix() + &step)) - run(&v, &(controls.matrix() - &step)))
            / (2.0 * h);
        let found = made.controls.view((7, n), (7, 1)).into_owned();
        assert!(
            (&found - &slope).norm() < 1e-6 * slope.norm(),
            "{found} {slope}"
        );
    }
}

/// All rows at once are those of one sweep a row; a record's tangent and its transpose are one linear map, with every integrator.
#[test]
fn rows_of_jacobians_are_sweeps() {
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::Midpoint,
        Integrator::Rk2,
        Integrator::Rk4,
        Integrator::VelocityEuler,
    ] {
        let sim = simulator(Settings::default().integrator(integrator).tolerance(1e-12));
        let (q, v) = (sim.start().0.clone(), DVector::from_element(7, 0.05));
        let state = sim.state(0, &q, &v).unwrap();
        let rollout = sim.rollout_from(&state, &push(&sim, 2), go_on).unwrap();
        let all = rollout.jacobians().unwrap();
        for row in 0..14 {
            let mut seed = rollout.zero_cotangents();
            let part = if row < 7 { &mut seed.q } else { &mut seed.v };
            part[(row % 7, 2)] = 1.0;
            let own = rollout.vjp(&seed).unwrap();
            let start: Vec<f64> = own
                .initial
                .q
                .iter()
                .chain(&own.initial.v)
                .copied()
                .collect();
            let near = |found: Vec<f64>, exact: &[f64]| {
                let (found, exact) = (DVector::from_vec(found), DVector::from_column_slice(exact));
                let error = (&found - &exact).norm();
                assert!(
                    error <= 1e-11 * all.state.norm(),
                    "{integrator:?} {row}: {error:e}"
                );
            };
            near(all.state.row(row).iter().copied().collect(), &start);
            near(
                all.controls.row(row).iter().copied().collect(),
                own.controls.as_slice(),
            );
        }

        // A step is a rollout of one, to the bit.
        let u = DVector::from_element(1, 0.5);
        let (next, record) = sim.step(&state, &u).unwrap();
        assert_eq!(&next, &rollout.states()[1]);
        let wave =
            |n: usize, phase: f64| DVector::from_fn(n, |i, _| (phase + 1.7 * i as f64).sin());
        let (along, du) = (wave(14, 0.3), wave(1, 0.9));
        let forth = record.jvp(&along, &du).unwrap();
        let bar = wave(14, 2.1);
        let mut seed = record.zero_cotangents();
        seed.q.set_column(1, &bar.rows(0, 7));
        seed.v.set_column(1, &bar.rows(7, 7));
        let back = record.vjp(&seed).unwrap();
        let product = bar.dot(&forth);
        let transposed = back.initial.q.dot(&along.rows(0, 7))
            + back.initial.v.dot(&along.rows(7, 7))
            + back.controls.column(0).dot(&du);
        let error = (product - transposed).abs();
        assert!(
            error <= 1e-9 * product.abs(),
            "{integrator:?}: {product} {transposed}"
        );
        assert!(record.jvp(&bar, &bar).is_err());
    }
}

#[test]
fn velocities_are_those_of_origins() {
    let sim = simulator(Settings::default());
    let (q, v) = (
        sim.start().0.clone(),
        DVector::from_fn(7, |i, _| 0.1 * i as f64),
    );
    let state = sim.state(0, &q, &v).unwrap();
    let rollout = sim.rollout_from(&state, &push(&sim, 1), go_on).unwrap();
    let found = rollout.velocities();
    assert_eq!(found.shape(), (12, 2));
    // The rail's speed, and the free joint's own six at a frame that isn't turned.
    // Both are read from the momenta, so up to rounding.
    assert!((found[(0, 0)] - v[0]).abs() < 1e-15);
    assert_eq!(found.view((1, 0), (5, 1)).norm(), 0.0);
    for i in 0..6 {
        assert!((found[(6 + i, 0)] - v[1 + i]).abs() < 1e-12);
    }
}

#[test]
fn triangles_are_a_mesh() {
    let shape = Shape::cuboid([0.1, 0.2, 0.3]);
    let mesh = hydrograd::shape::build(&shape, "".as_ref(), Some(100)).unwrap();
    let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|v| (*v).into()).collect();
    let made = Shape::triangles(vertices.clone(), mesh.faces());
    let again = hydrograd::shape::build(&made, "".as_ref(), Some(7)).unwrap();
    assert_eq!(
        (again.vertices(), again.faces()),
        (mesh.vertices(), mesh.faces())
    );
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(made).density(1000.0));
    let text = scene.to_toml().unwrap();
    assert_eq!(Scene::from_toml(&text, "").unwrap(), scene);
    let mass = Simulator::new(&scene, Settings::default())
        .unwrap()
        .parameters()
        .mass(0);
    assert!((mass - 6.0).abs() < 1e-9);

    let hole = Shape::triangles(vertices, &mesh.faces()[1..]);
    let error = hydrograd::shape::build(&hole, "".as_ref(), None).unwrap_err();
    assert!(matches!(error, Error::Mesh { .. }), "{error}");
}

/// What ran before a step failed isn't lost, and can be differentiated.
#[test]
fn a_run_that_fails_keeps_what_ran() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (name, x) in [("left", 0.0), ("right", 0.25)] {
        let body = Body::new(Shape::sphere(0.1).faces(80)).named(name);
        scene.add(body.density(1000.0).at([x, 0.0, 0.0]));
    }
    scene.time_step = 0.01;
    scene.initial.v = vec![0.0; 12];
    scene.initial.v[0] = 0.5;
    scene.initial.v[6] = -0.5;
    let settings = Settings::default().fidelity(Fidelity::Reduced).films(false);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let controls = Controls::zeros(&simulator, 40);
    let start = simulator.initial().unwrap();
    let go = |_| std::ops::ControlFlow::Continue(());
    let halted = simulator.rollout_as_far(&start, &controls, go);
    let halted = halted.err().unwrap();
    says(&halted.error, &["left", "right"]);
    let ran = halted.rollout.unwrap();
    assert!(halted.step > 2 && ran.steps() > 0 && ran.steps() <= halted.step);
    assert!((halted.time - 0.01 * halted.step as f64).abs() < 1e-12);
    // From the same state: at a given velocity the momentum's is its own to round-off alone.
    let controls_run = Controls::zeros(&simulator, ran.steps());
    let whole = simulator.rollout_from(&start, &controls_run, go).unwrap();
    assert_eq!(ran.q(), whole.q());
    let mut seed = ran.zero_cotangents();
    seed.q.fill(1.0);
    assert_eq!(
        ran.vjp(&seed).unwrap().initial,
        whole.vjp(&seed).unwrap().initial
    );
    let error = simulator.rollout(&controls).err().unwrap();
    assert_eq!(error.to_string(), halted.error.to_string());
}
