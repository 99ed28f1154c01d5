//! Joints and forces that have answers on paper.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Mimic, Scene, Shape, Spring, Tendon};
use hydrograd::simulate::Sample;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

const GRAVITY: f64 = 9.81;

/// A dry body of mass 2 kg and inertia 0.3 kg m² about z, on a joint.
fn dry(name: &str, joint: Joint) -> Body {
    let body = Body::dry().named(name).mass(2.0);
    body.inertia([0.2, 0.25, 0.3]).joint(joint)
}

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

/// Every group of the gradient against differences.
fn gradients(scene: &Scene, integrator: Integrator) {
    let mut simulator = simulator(scene, integrator);
    let settings = gradcheck::GradcheckSettings {
        steps: 20,
        directions: 2,
        seed: 1,
        timings: 0,
        enough: Some(1e-7),
    };
    let report = gradcheck(&mut simulator, &settings).unwrap();
    assert!(report.max_rel_error < 1e-7, "{report:?}");
}

/// A nut on an upright thread under its weight: with h = pitch / 2π, (m h² + I) ω̇ = −m g h.
#[test]
fn a_nut_runs_down_its_thread() {
    for pitch in [0.5, -0.2] {
        let mut scene = Scene::new(Fluid::none());
        scene.gravity = [0.0, 0.0, -GRAVITY];
        let axis = [0.0, 0.0, 2.0];
        scene.add(dry("nut", Joint::Screw { axis, pitch }));
        let sim = simulator(&scene, Integrator::Rk2);
        let rollout = sim.rollout(&Controls::zeros(&sim, 100)).unwrap();
        let last = rollout.samples().last().unwrap();
        let h = pitch / TAU;
        let rate = -2.0 * GRAVITY * h / (2.0 * h * h + 0.3) * last.time;
        assert!((last.v[0] / rate - 1.0).abs() < 1e-12, "{}", last.v[0]);
        let angle = 0.5 * rate * last.time;
        assert!((last.q[0] / angle - 1.0).abs() < 1e-12, "{}", last.q[0]);
        let down = last.poses[0].translation;
        assert!((down.z - h * angle).abs() < 1e-12 && down.xy().norm() < 1e-15);
        assert!((last.energy() - rollout.samples()[0].energy()).abs() < 1e-12);
        gradients(&scene, Integrator::Rk4);
    }
}

/// Two weights on a rail, a spring between them: they swing about their common centre with the period of the reduced mass, and
/// the energy of the spring is what motion gives and takes.
#[test]
fn weights_on_a_spring_swing_with_their_period() {
    let axis = [1.0, 0.0, 0.0];
    let (stiffness, rest) = (30.0, 0.4);
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 1e-3;
    scene.add(dry("left", Joint::Prismatic { axis }));
    let right = dry("right", Joint::Prismatic { axis });
    scene.add(right.mass(3.0).at([0.7, 0.0, 0.0]));
    let spring = Spring::new("left").at([0.05, 0.0, 0.0]);
    let spring = spring.to("right", [-0.05, 0.0, 0.0]);
    scene.add_force(spring.stiffness(stiffness).rest_length(rest).into());
    let sim = simulator(&scene, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 1000)).unwrap();
    let samples = rollout.samples();
    let stretch = |s: &Sample| s.q[1] - s.q[0] + 0.6 - rest;
    let frequency = (stiffness * (1.0 / 2.0 + 1.0 / 3.0)).sqrt();
    let (energy, first) = (samples[0].energy(), stretch(&samples[0]));
    assert!((energy - 0.5 * stiffness * 0.2 * 0.2).abs() < 1e-15);
    for s in samples {
        let exact = first * (frequency * s.time).cos();
        assert!((stretch(s) - exact).abs() < 1e-10, "{}", stretch(s) - exact);
        assert!((s.energy() - energy).abs() < 1e-10);
    }
}

/// Any motion: a tumbling body between an anchor and another body, with dampers, in a scene file and back.
#[test]
fn springs_of_tumbling_bodies_have_gradients() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    for (name, x) in [("buoy", 0.0), ("float", 0.5)] {
        let body = Body::new(Shape::ellipsoid([0.1, 0.08, 0.05]).faces(20));
        scene.add(body.named(name).density(700.0).at([x, 0.1, 0.0]));
    }
    scene.initial.v = vec![
        0.1, 0.2, -0.1, 0.5, 0.3, 0.2, 0.0, -0.1, 0.1, 0.2, 0.4, -0.6,
    ];
    let tether = Spring::new("buoy").named("tether").at([0.0, 0.0, -0.05]);
    let tether = tether.anchored([0.1, 0.0, -0.8]).stiffness(60.0);
    scene.add_force(tether.rest_length(0.6).damping(2.0).into());
    let link = Spring::new("buoy").at([0.1, 0.0, 0.0]);
    let link = link.to("float", [-0.1, 0.02, 0.0]).stiffness(20.0);
    scene.add_force(link.damping(0.5).into());
    assert_eq!(
        Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap(),
        scene
    );
    let sim = simulator(&scene, Integrator::Rk2);
    let names: Vec<&str> = sim.parameters().names().collect();
    for name in ["tether.stiffness", "tether.rest_length", "spring 2.damping"] {
        assert!(names.contains(&name), "{names:?}");
    }
    for integrator in [Integrator::MomentumEuler, Integrator::Rk4] {
        gradients(&scene, integrator);
    }
}

/// Energy leaves by the damper alone, and a spring whose ends meet pulls nowhere.
#[test]
fn a_damper_takes_energy_and_ends_may_meet() {
    let mut scene = Scene::new(Fluid::none());
    scene.add(dry("weight", Joint::Free));
    scene.add_force(
        Spring::new("weight")
            .stiffness(5.0)
            .rest_length(0.3)
            .damping(1.0)
            .into(),
    );
    let run = |scene: &Scene| {
        let sim = simulator(scene, Integrator::Rk4);
        let rollout = sim.rollout(&Controls::zeros(&sim, 50)).unwrap();
        let seed = rollout.zero_cotangents();
        let g = rollout.vjp(&seed).unwrap();
        assert!(g.parameters.to_vec().iter().all(|x| x.is_finite()));
        rollout.samples().to_vec()
    };
    assert!(
        run(&scene)
            .iter()
            .all(|s| s.poses[0].translation.norm() == 0.0)
    );
    scene.initial.v = vec![0.4, 0.0, 0.0, 0.0, 0.0, 0.0];
    scene.bodies[0].placement.position = [0.2, 0.1, 0.0];
    let energies: Vec<f64> = run(&scene).iter().map(Sample::energy).collect();
    assert!(energies.windows(2).all(|e| e[1] <= e[0] + 1e-12));
    assert!(energies[50] < 0.9 * energies[0], "{energies:?}");
}

/// Without a rest length a spring is linear where its ends meet: gradients from there are those of an oscillator.
#[test]
fn a_spring_without_length_has_a_slope_where_its_ends_meet() {
    let mut scene = Scene::new(Fluid::none());
    scene.add(dry("weight", Joint::Free));
    scene.add_force(Spring::new("weight").stiffness(50.0).into());
    let sim = simulator(&scene, Integrator::Rk4);
    let rollout = sim.rollout(&Controls::zeros(&sim, 100)).unwrap();
    let mut seed = rollout.zero_cotangents();
    seed.q[(0, 100)] = 1.0;
    let gradient = rollout.vjp(&seed).unwrap();
    let omega = f64::sqrt(50.0 / 2.0);
    let right = (omega * rollout.samples()[100].time).sin() / omega;
    let found = gradient.initial.v[0];
    assert!((found - right).abs() < 1e-6, "{found} for {right}");
    gradients(&scene, Integrator::MomentumEuler);
}

#[test]
fn springs_that_can_not_be_are_refused() {
    let refused = |spring: Spring, words: &[&str]| {
        let mut scene = Scene::new(Fluid::none());
        for name in ["a", "b"] {
            scene.add(dry(name, Joint::Free));
        }
        scene.add_force(spring.into());
        says(scene.validate().unwrap_err().to_string(), words);
    };
    let good = || Spring::new("a").stiffness(1.0);
    refused(Spring::new("c"), &["forces[0].body", "\"c\"", "a, b"]);
    refused(good().to("c", [0.0; 3]), &["forces[0].to", "\"c\""]);
    refused(
        good().to("a", [0.0; 3]),
        &["forces[0].to", "one rigid body"],
    );
    refused(good().at([f64::NAN, 0.0, 0.0]), &["forces[0].at", "NaN"]);
    refused(
        good().stiffness(-1.0),
        &["forces[0].stiffness", "-1", "N/m"],
    );
    refused(good().rest_length(-1.0), &["forces[0].rest_length", "-1"]);
    refused(good().damping(f64::INFINITY), &["forces[0].damping", "inf"]);
    refused(good().named("b"), &["forces[0].name", "\"b\""]);
    let text = "time_step = 0.01\nsteps = 1\nfluid = { density = 0 }\nbodies = []\n\
                [[forces]]\nkind = \"spring\"\nbody = \"a\"\nstiffness = 1\nlenght = 2\n";
    let error = Scene::from_toml(text, "").unwrap_err().to_string();
    says(&error, &["lenght", "rest_length"]);
}

/// Two wheels on a tendon.
fn wheels(tendon: Tendon) -> Scene {
    let mut scene = Scene::new(Fluid::none());
    scene.time_step = 0.002;
    let axis = [0.0, 0.0, 1.0];
    for name in ["a", "b"] {
        scene.add(dry(name, Joint::Revolute { axis }));
    }
    scene.add_force(tendon.into());
    scene
}

/// Pulled all at once, two wheels swing about where the tendon is pulled to, each by its arm: Σ r q = g u (1 − cos ωt), ω² = k Σ r²/I. Left alone they keep their energy, and a damper
/// takes it.
#[test]
fn wheels_on_a_tendon_swing_with_their_period() {
    let (arms, stiffness, gain, pulled) = ([0.3, -0.2], 400.0, 0.05, 2.0);
    let tendon = || Tendon::new([("a", arms[0]), ("b", arms[1])]).stiffness(stiffness);
    let sim = simulator(&wheels(tendon().gain(gain)), Integrator::Rk4);
    let controls = DMatrix::from_element(1, 200, pulled);
    let controls = Controls::from_matrix(&sim, controls).unwrap();
    let rollout = sim.rollout(&controls).unwrap();
    let square = arms[0] * arms[0] + arms[1] * arms[1];
    let rate = (stiffness * square / 0.3_f64).sqrt();
    for s in rollout.samples() {
        let length = gain * pulled * (1.0 - (rate * s.time).cos());
        for (k, arm) in arms.iter().enumerate() {
            let exact = arm / square * length;
            assert!((s.q[k] - exact).abs() < 1e-6, "{} {exact}", s.q[k]);
        }
    }
    let mut alone = wheels(tendon());
    alone.initial.v = vec![0.4, -0.25];
    let energies = |scene: &Scene| -> Vec<f64> {
        let sim = simulator(scene, Integrator::Rk4);
        let rollout = sim.rollout(&Controls::zeros(&sim, 200)).unwrap();
        assert!(rollout.warnings().is_empty(), "{:?}", rollout.warnings());
        rollout.samples().iter().map(Sample::energy).collect()
    };
    let kept = energies(&alone);
    assert!(kept.iter().all(|e| (e / kept[0] - 1.0).abs() < 1e-6));
    let mut damped = wheels(tendon().damping(5.0));
    damped.initial.v = alone.initial.v.clone();
    let lost = energies(&damped);
    assert!(lost.windows(2).all(|e| e[1] <= e[0] + 1e-12) && lost[200] < 0.7 * lost[0]);
    gradients(&damped, Integrator::Rk4);
    gradients(&damped, Integrator::Midpoint);
}

#[test]
fn tendons_that_can_not_be_are_refused() {
    let refused = |tendon: Tendon, words: &[&str]| {
        says(wheels(tendon).validate().unwrap_err(), words);
    };
    let good = || Tendon::new([("a", 0.3)]).stiffness(40.0);
    refused(
        Tendon::new([("c", 0.3)]).stiffness(1.0),
        &["arms.c", "a, b"],
    );
    let none: [(&str, f64); 0] = [];
    refused(Tendon::new(none).stiffness(1.0), &["arms", "none"]);
    let unlike = Tendon::new([("a", f64::NAN)]).stiffness(1.0);
    refused(unlike, &["arms.a", "NaN", "lever arm"]);
    refused(good().stiffness(0.0), &["stiffness", "above zero"]);
    refused(good().damping(-1.0), &["damping", "-1"]);
    refused(good().gain(f64::INFINITY), &["gain", "inf"]);
    let mut scene = wheels(good());
    scene.bodies[0].joint = Joint::Free;
    says(
        scene.validate().unwrap_err(),
        &["arms.a", "free joint", "revolute"],
    );
    let mut scene = wheels(good());
    scene.bodies[0].mimic = Some(Mimic::new("b"));
    says(
        scene.validate().unwrap_err(),
        &["arms.a", "coordinate of its own", "\"b\" that arm", "0.3 m"],
    );
}

/// Two cranks of 0.5 m and a coupler of 0.6 m between their ends, a parallelogram, whose loop a spring closes: the pendulum of one coordinate that it would be with a pin, but for the stretch of the spring.
#[test]
fn a_stiff_spring_closes_a_loop() {
    let hinge = || Joint::Revolute {
        axis: [0.0, 1.0, 0.0],
    };
    let body = |name: &str, mass: f64, inertia: f64, center: [f64; 3]| {
        let body = Body::dry().named(name).mass(mass).inertia([inertia; 3]);
        body.center_of_mass(center).joint(hinge())
    };
    let start = 0.8;
    let world = || {
        let mut scene = Scene::new(Fluid::none());
        scene.gravity = [0.0, 0.0, -GRAVITY];
        scene.time_step = 5e-3;
        scene
    };
    let closed = |stiffness: f64| {
        let mut scene = world();
        let crank = |name| body(name, 1.0, 0.02, [0.0, 0.0, -0.25]);
        scene.add(crank("a"));
        scene.add(crank("b").at([0.6, 0.0, 0.0]));
        let coupler = body("coupler", 2.0, 0.06, [0.3, 0.0, 0.0]);
        scene.add(Body {
            parent: Some("a".into()),
            ..coupler.at([0.0, 0.0, -0.5])
        });
        let pin = Spring::new("coupler")
            .at([0.6, 0.0, 0.0])
            .to("b", [0.0, 0.0, -0.5]);
        scene.add_force(pin.stiffness(stiffness).into());
        scene.initial.q = vec![start, start, -start];
        scene
    };
    // Of the same inertia and weight about its hinge as the three together.
    let inertia = 2.0 * (0.02 + 0.25 * 0.25) + 2.0 * 0.5 * 0.5;
    let center = (2.0 * 0.25 + 2.0 * 0.5) / 4.0;
    let mut one = world();
    one.add(body(
        "one",
        4.0,
        inertia - 4.0 * center * center,
        [0.0, 0.0, -center],
    ));
    one.initial.q = vec![start];
    let run = |scene: &Scene, integrator| {
        let sim = simulator(scene, integrator);
        sim.rollout(&Controls::zeros(&sim, 400)).unwrap()
    };
    let right = run(&one, Integrator::Rk4);
    for stiffness in [1e4, 1e6] {
        let rollout = run(&closed(stiffness), Integrator::Midpoint);
        assert!(rollout.warnings().is_empty(), "{:?}", rollout.warnings());
        let (mut off, mut gap) = (0.0_f64, 0.0_f64);
        for (s, right) in rollout.samples().iter().zip(right.samples()) {
            off = off.max((s.q[0] - right.q[0]).abs());
            let [coupler, b] = [(2, [0.6, 0.0, 0.0]), (1, [0.0, 0.0, -0.5])]
                .map(|(body, point): (usize, [f64; 3])| s.poses[body].apply(&point.into()));
            gap = gap.max((coupler - b).norm());
        }
        println!("{stiffness:.0e} N/m: {off:.1e} rad off, {gap:.1e} m open");
        assert!(off < 80.0 / stiffness && gap < 30.0 / stiffness);
    }
    let mut held = closed(1e4);
    held.time_step = 1e-3;
    gradients(&held, Integrator::Midpoint);
}
