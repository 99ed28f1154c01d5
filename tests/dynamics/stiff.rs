//! Forces too stiff for the step of an integrator that takes them where it starts: told before a run, with the step that would do.

use crate::support::INTEGRATORS;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Damping, Drag, DragPart, Fluid, Joint, Passive, Scene, Servo, Shape, Spring, Tendon,
    Thruster,
};
use hydrograd::{Controls, Fidelity, Settings, Simulator};

/// The step that a warning names, s.
fn named_step(warning: &str) -> f64 {
    let (_, step) = warning.split_once("take a time step under ").unwrap();
    step.split(' ').next().unwrap().parse().unwrap()
}

/// A sphere at rest in drag that RK2 can't take: the run is at rest, and its gradient would be beyond belief. The warning has the numbers, and the step that would do.
#[test]
fn stiff_drag_is_told_before_a_run_and_at_rest() {
    let made = |integrator, linear: f64, dt: f64| {
        let mut scene = Scene::new(Fluid::fresh_water());
        let drag = Drag {
            part: DragPart::Total,
            linear,
            ..Drag::default()
        };
        scene.add(
            Body::new(Shape::sphere(0.1).faces(80))
                .density(1000.0)
                .drag(drag),
        );
        scene.time_step = dt;
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        Simulator::new(&scene, settings.integrator(integrator)).unwrap()
    };
    for integrator in [Integrator::Rk2, Integrator::Rk4, Integrator::VelocityEuler] {
        let simulator = made(integrator, 1e4, 0.01);
        let before = simulator.start_stiffness_warning().expect("a warning");
        println!("{before}");
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 30)).unwrap();
        assert_eq!(rollout.warnings(), std::slice::from_ref(&before));
        // With the step that it names there is none, and just above it there is.
        let (_, step) = before.split_once("take a time step under ").unwrap();
        let step: f64 = step.split(' ').next().unwrap().parse().unwrap();
        let warned = |dt| {
            made(integrator, 1e4, dt)
                .start_stiffness_warning()
                .is_some()
        };
        assert!(!warned(0.99 * step) && warned(1.01 * step), "{step}");
    }
    for integrator in [Integrator::MomentumEuler, Integrator::Midpoint] {
        assert!(
            made(integrator, 1e5, 0.01)
                .start_stiffness_warning()
                .is_none()
        );
    }
    assert!(
        made(Integrator::Rk2, 10.0, 0.01)
            .start_stiffness_warning()
            .is_none()
    );
}

fn simulator(scene: &Scene, integrator: Integrator, dt: f64) -> Simulator {
    let scene = Scene {
        time_step: dt,
        ..scene.clone()
    };
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(&scene, settings.integrator(integrator)).unwrap()
}

/// How many times as fast as it ever moves at the start something moves after 3,000 steps.
fn grown(sim: &Simulator) -> f64 {
    let Ok(rollout) = sim.rollout(&Controls::zeros(sim, 3000)) else {
        return f64::INFINITY;
    };
    let speed = |s: &hydrograd::simulate::Sample| s.v.amax();
    let samples = rollout.samples();
    let early = samples[..30].iter().map(speed).fold(0.0, f64::max);
    let late = samples[2970..].iter().map(speed).fold(0.0, f64::max);
    late / early
}

fn slide(name: &str) -> Body {
    let axis = [1.0, 0.0, 0.0];
    (Body::dry().named(name).mass(0.8))
        .inertia([0.2, 0.25, 0.3])
        .joint(Joint::Prismatic { axis })
}

/// Two slides of 0.8 kg, pulled to the world or to each other in four ways, started apart from rest: with the angular frequency of the faster swing.
fn swings() -> Vec<(&'static str, Scene, f64)> {
    let stiffness = 2e5;
    let two = |first: Body, second: Body, apart: [f64; 3]| {
        let mut scene = Scene::new(Fluid::none());
        scene.add(first);
        scene.add(second.at(apart));
        scene.initial.q = vec![1e-3, 0.0];
        scene
    };
    let (a, b) = (|| slide("a"), || slide("b"));
    let aside = [0.0, 1.0, 0.0];
    let passive = Passive::default().stiffness(stiffness);
    let joint = two(a().passive(passive), b(), aside);
    // Its length is 1 m at rest, so that only the stretch of it holds.
    let mut world = two(a(), b(), aside);
    let spring = Spring::new("a")
        .anchored([-1.0, 0.0, 0.0])
        .stiffness(stiffness)
        .rest_length(1.0);
    world.add_force(spring.into());
    let mut tendon = two(a().passive(Passive::default().stiffness(1.0)), b(), aside);
    let over = Tendon::new([("a", 1.0), ("b", -1.0)]).stiffness(stiffness);
    tendon.add_force(over.into());
    let mut between = two(a(), b(), [1.0, 0.0, 0.0]);
    let spring = Spring::new("a")
        .to("b", [0.0; 3])
        .stiffness(stiffness)
        .rest_length(1.0);
    between.add_force(spring.into());
    let alone = (stiffness / 0.8_f64).sqrt();
    let both = (2.0 * stiffness / 0.8_f64).sqrt();
    vec![
        ("passive joint", joint, alone),
        ("spring to the world", world, alone),
        ("tendon", tendon, both),
        ("spring between", between, both),
    ]
}

#[test]
fn stiff_springs_are_told_before_a_run() {
    for (what, scene, frequency) in swings() {
        for integrator in INTEGRATORS {
            let Some(limit) = integrator.swing_limit() else {
                let sim = simulator(&scene, integrator, 0.1);
                assert!(sim.start_stiffness_warning().is_none());
                continue;
            };
            let step = limit / frequency;
            let [under, over] = [0.99, 1.01].map(|part| simulator(&scene, integrator, part * step));
            assert_eq!(
                under.start_stiffness_warning(),
                None,
                "{what} {integrator:?}"
            );
            let warning = over.start_stiffness_warning().expect(what);
            let rollout = over.rollout(&Controls::zeros(&over, 3)).unwrap();
            assert_eq!(rollout.warnings()[0], warning);
            assert!(
                (named_step(&warning) / step - 1.0).abs() < 0.01,
                "{warning}"
            );
            // It is where runs begin to grow without bound; with RK2 all grow.
            let [held, lost] = [&under, &over].map(grown);
            println!(
                "{what}, {integrator:?}: {held:.1e} times as fast under it, {lost:.1e} over it"
            );
            assert!(
                integrator == Integrator::Rk2 || held < 30.0,
                "{what} {integrator:?}: {held}"
            );
            assert!(lost > 30.0, "{what} {integrator:?}: {lost}");
        }
    }
}

/// Steps that solve for the velocity bear what is damped or driven as well.
#[test]
fn implicit_damping_and_servos_bear_stiffer_springs() {
    let dt = 0.01;
    let made = |body: Body| {
        let mut scene = Scene::new(Fluid::none());
        scene.add(body);
        scene.initial.q = vec![1e-3];
        simulator(&scene, Integrator::MomentumEuler, dt)
    };
    // Δt² k = 4 m + 2 Δt c.
    let (mass, damping) = (0.8, 500.0);
    let limit = (4.0 * mass + 2.0 * dt * damping) / (dt * dt);
    for (part, stable) in [(0.98, true), (1.02, false)] {
        let passive = Passive::default().stiffness(part * limit).damping(damping);
        let sim = made(slide("a").passive(passive));
        assert_eq!(sim.start_stiffness_warning().is_none(), stable);
        let grown = grown(&sim);
        assert_eq!(grown < 1.0, stable, "{grown}");
    }
    let servo = Servo {
        stiffness: 1e7,
        damping: 0.0,
    };
    let sim = made(slide("a").actuated().servo(servo));
    assert_eq!(sim.start_stiffness_warning(), None);
    assert!(grown(&sim) < 1.0);
}

/// A rotor that lags by 0.2 s, and pushes a hull on which it isn't: a time constant of 0.2 s is what there is to resolve, however small the rotor's inertia, in which no equation has it. Not told, and not cut.
#[test]
fn what_acts_one_way_only_is_not_stiff() {
    let axis = [1.0, 0.0, 0.0];
    for inertia in [30.0, 1e-3, 1e-5, 1e-9] {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.add(Body::new(Shape::sphere(0.1)).named("hull").mass(4.0));
        let rotor = Body::dry().named("rotor").mass(1.0).inertia([inertia; 3]);
        scene.add(rotor.joint(Joint::Revolute { axis }));
        let thruster = Thruster::new("hull").direction(axis).polynomial([40.0]);
        scene.add_force(thruster.rotor("rotor", 0.2).into());
        for integrator in INTEGRATORS {
            let simulator = simulator(&scene, integrator, 0.05);
            let warned = simulator.start_stiffness_warning();
            assert_eq!(warned, None, "{integrator:?}, {inertia}");
            let ones = nalgebra::DMatrix::from_element(1, 100, 1.0);
            let controls = Controls::from_matrix(&simulator, ones).unwrap();
            let rollout = simulator.rollout(&controls).unwrap();
            assert_eq!(rollout.summary().cut_steps, 0, "{integrator:?}, {inertia}");
            // n = 1 − e^(−t/T), by the method's own error of its step.
            let off = rollout.samples().iter().map(|s| {
                let exact = 1.0 - (-s.time / 0.2).exp();
                (s.v[6] - exact).abs()
            });
            let off = off.fold(0.0, f64::max);
            println!("{integrator:?}, J = {inertia}: n off by {off:.1e}");
            let most = match integrator {
                Integrator::Rk4 => 1e-4,
                Integrator::Rk2 | Integrator::Midpoint => 5e-3,
                _ => 0.06,
            };
            assert!(off < most, "{integrator:?}, {inertia}: {off}");
        }
    }
}

/// Damping that turns what it slows, D = [a, k; −k, b] over m/Δt: told where steps let it grow, and not where they don't.
#[test]
fn damping_that_turns_is_told_where_it_grows() {
    let dt = 0.01;
    let mass = 998.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-3 * 1.5;
    let (mut told, mut calm) = (0, 0);
    for integrator in [Integrator::VelocityEuler, Integrator::Rk2, Integrator::Rk4] {
        let limit = integrator.damping_limit().unwrap();
        for (a, b, k) in [
            (0.8, 0.8, 0.0),
            (1.2, 0.0, 0.0),
            (1.2, 0.0, 1.0),
            (1.2, 0.05, 2.0),
            (0.25, 0.25, 2.0),
            (0.05, 0.05, 1.5),
            (0.3, 0.3, 0.3),
            (0.5, 0.5, 0.45),
            (0.4, 0.2, 0.2),
            (0.01, 0.01, 0.1),
        ] {
            let size = limit * mass / dt;
            let mut scene = Scene::new(Fluid::fresh_water());
            scene.fluid.density = 998.0;
            scene.add(Body::new(Shape::sphere(0.1)).named("ball").density(998.0));
            let mut rows = [[0.0; 6]; 6];
            (rows[0][0], rows[1][1]) = (a * size, b * size);
            (rows[0][1], rows[1][0]) = (k * size, -k * size);
            (0..6).for_each(|i| rows[i][i] += if i > 1 { 0.1 } else { 0.0 });
            scene.add_force(Damping::new("ball").linear(rows).into());
            scene.initial.v = vec![0.5, 0.2, -0.1, 0.3, 0.2, -0.4];
            let simulator = simulator(&scene, integrator, dt);
            let is_told = simulator.start_stiffness_warning().is_some();
            let made = simulator.rollout(&Controls::zeros(&simulator, 400));
            // What has got fast may turn, and keep its speed then.
            let speed = made.map_or(f64::INFINITY, |r| {
                let each = r.samples().iter().map(|s| s.v.rows(0, 2).norm());
                each.fold(0.0, f64::max)
            });
            println!("{integrator:?} {a} {b} {k}: told {is_told}, at most {speed:.1e} m/s");
            assert_eq!(is_told, speed > 5.0, "{integrator:?} {a} {b} {k}: {speed}");
            match is_told {
                true => told += 1,
                false => calm += 1,
            }
        }
    }
    assert!(told >= 12 && calm >= 9, "{told} {calm}");
}
