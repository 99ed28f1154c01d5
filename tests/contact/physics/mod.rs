//! Contact against known answers: the motion in one dimension, what a gradient should be, and energy.

mod energy;
mod impact;
mod modes;
mod smooth;

use hydrograd::adjoint::lie::{Vec6, point_velocity};
use hydrograd::dynamics::{Evaluation, Input, Integrator, Linearisation, State, Stepper};
use hydrograd::scene::{Contact, Fluid, Joint, Scene};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DVector;

const GRAVITY: f64 = 9.81;
const RAIL: Joint = Joint::Prismatic {
    axis: [0.0, 0.0, 1.0],
};

/// Under gravity, without a wall.
fn scene(density: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.contact = Some(Contact::default());
    scene
}

/// Above a floor at z = 0.
fn above_floor(density: f64) -> Scene {
    let mut scene = scene(density);
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene
}

fn contact(scene: &mut Scene) -> &mut Contact {
    scene.contact.get_or_insert_default()
}

fn simulator(scene: &Scene, fidelity: Fidelity) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(Integrator::MomentumEuler);
    Simulator::new(scene, settings).unwrap()
}

fn isolated(scene: &Scene) -> Simulator {
    simulator(scene, Fidelity::Isolated)
}

fn run(simulator: &Simulator, steps: usize) -> Rollout<'_> {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    let finite = |x: &DVector<f64>| x.iter().all(|x| x.is_finite());
    assert!(
        rollout
            .samples()
            .iter()
            .all(|s| finite(&s.q) && finite(&s.v))
    );
    rollout
}

/// Numbers by a linear congruential generator: the same on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn three(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(-size, size))
    }
}

/// A step's velocities before and after contact.
fn velocities<'a>(
    stepper: &Stepper<'a>,
    e: &Linearisation<'a>,
    state: &State,
    v: &DVector<f64>,
) -> [DVector<f64>; 2] {
    let input = Input {
        control: DVector::zeros(e.system.controls),
        hold: Vec::new(),
    };
    let both = stepper.step(e, state, v, &input).unwrap().memo.unwrap();
    [0, 1].map(|k| both.rows(k * v.len(), v.len()).into_owned())
}

/// ∫ s(g₀ − φ) of the law, from the compression x = g₀ − φ.
fn compressed(x: f64, width: f64) -> f64 {
    if x <= -width {
        0.0
    } else if x >= width {
        0.5 * x * x + width * width / 6.0
    } else {
        (x + width).powi(3) / (12.0 * width)
    }
}

/// Elastic energy of all contacts at a configuration, J.
fn elastic(e: &Evaluation) -> f64 {
    let of = |t: &hydrograd::dynamics::PairContact| {
        t.law.stiffness * t.point.weight * compressed(t.law.gap - t.point.gap, t.law.width)
    };
    e.contact_points.iter().map(of).sum()
}

/// What the contacts give up, by their law, between the configuration and what is foreseen with the velocity v, J.
fn released(e: &Evaluation, v: &DVector<f64>) -> f64 {
    let twists = e.system.tree.twists(&e.kinematics, v);
    let mut out = 0.0;
    for t in &e.contact_points {
        let relative: Vec6 = twists[t.first] - t.second.map_or(Vec6::zeros(), |b| twists[b]);
        let u = point_velocity(&relative, &t.point.position);
        let along = u.dot(&t.point.normal);
        let across = (u - along * t.point.normal).norm_squared();
        let slip = (across + t.law.stiction_speed.powi(2)).sqrt() - t.law.stiction_speed;
        let approach = along - t.law.friction * slip;
        let x = t.law.gap - t.point.gap;
        let given =
            compressed(x, t.law.width) - compressed(x - t.law.horizon * approach, t.law.width);
        out += t.law.stiffness * t.point.weight * given;
    }
    out
}
