//! Joints and forces that have answers on paper.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Scene};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Settings, Simulator};
use std::f64::consts::TAU;

const GRAVITY: f64 = 9.81;

/// A dry body of mass 2 kg and inertia 0.3 kg m² about z, on a joint.
fn dry(name: &str, joint: Joint) -> Body {
    let body = Body::dry().named(name).mass(2.0);
    body.inertia([0.2, 0.25, 0.3]).joint(joint)
}

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    Simulator::new(scene, Settings::default().integrator(integrator)).unwrap()
}

/// Every group of the gradient against differences.
fn gradients(scene: &Scene, integrator: Integrator) {
    let mut simulator = simulator(scene, integrator);
    let settings = gradcheck::Settings {
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
