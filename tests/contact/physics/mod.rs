//! Contact against known answers: the motion in one dimension, what a gradient should be, and energy.

mod energy;
mod impact;
mod modes;
mod smooth;

use super::tools::{RAIL, above_floor, contact, touching};
use crate::support::{self, GRAVITY, run};
use hydrograd::adjoint::lie::{Vec6, point_velocity};
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::{Dual, Evaluation, Input, Integrator, Linearisation, State, Stepper};
use hydrograd::scene::Scene;
use hydrograd::{Fidelity, Simulator};
use nalgebra::DVector;

fn simulator(scene: &Scene, fidelity: Fidelity) -> Simulator {
    support::simulator(scene, fidelity, Integrator::MomentumEuler)
}

fn isolated(scene: &Scene) -> Simulator {
    simulator(scene, Fidelity::Isolated)
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
    let (_, record) = stepper.step(e, state, v, &input).unwrap();
    let velocities = record.contact_velocities().unwrap().clone();
    let before = match velocities.held {
        None => velocities.before,
        // The one before has with it what contact bore already.
        Some(_) => {
            let impulse = stepper.dt * e.contact_force(&velocities.after, Dual::User);
            let mass = e.mass_matrix().clone().cholesky().unwrap();
            &velocities.after - mass.solve(&impulse)
        }
    };
    [before, velocities.after]
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
