//! Joints and forces that have answers on paper.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape, Spring};
use hydrograd::simulate::Sample;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
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
