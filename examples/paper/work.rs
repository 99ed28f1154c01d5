//! Work of the swimmer's motors: what they do at their joints, Σ max(0, u Δq) over steps and motors. A motor that brakes gets nothing back.

use hydrograd::simulate::{Observation, Sample};
use hydrograd::{Result, Rollout};
use nalgebra::DVector;

/// The first hinge among the coordinates and velocities; the head's three come before.
pub const HINGE: usize = 3;
pub const MOTORS: usize = 3;

/// Angle, rad, by which each motor's joint turns in a step, and the torque on it.
fn turns(pair: &[Sample]) -> [(f64, f64); MOTORS] {
    let (now, next) = (&pair[0], &pair[1]);
    std::array::from_fn(|k| (next.q[HINGE + k] - now.q[HINGE + k], now.control[k]))
}

/// Work of all motors up to each state, J.
pub fn motors(rollout: &Rollout) -> Vec<f64> {
    summed(rollout, |(turn, torque)| (turn * torque).max(0.0))
}

/// The same, were all braking paid back.
pub fn net(rollout: &Rollout) -> Vec<f64> {
    summed(rollout, |(turn, torque)| turn * torque)
}

fn summed(rollout: &Rollout, of: impl Fn((f64, f64)) -> f64) -> Vec<f64> {
    let steps = rollout.samples().windows(2);
    let works = steps.map(|pair| turns(pair).map(&of).iter().sum::<f64>());
    let sums = works.scan(0.0, |sum, work| {
        *sum += work;
        Some(*sum)
    });
    [0.0].into_iter().chain(sums).collect()
}

/// Derivative of the work of the whole run by the controller's gains, J by unit of each.
pub fn by_gains(rollout: &Rollout) -> Result<Vec<f64>> {
    let mut bars = rollout.zero_cotangents();
    let policy = rollout.simulator().policy();
    let mut direct = vec![0.0; policy.gains().len()];
    for (n, pair) in rollout.samples().windows(2).enumerate() {
        let mut torque_bar = DVector::zeros(MOTORS);
        for (k, (turn, torque)) in turns(pair).into_iter().enumerate() {
            if turn * torque > 0.0 {
                torque_bar[k] = turn;
                bars.q[(HINGE + k, n + 1)] += torque;
                bars.q[(HINGE + k, n)] -= torque;
            }
        }
        // Torques are the controller's: their cotangent goes through it, to what it observed and to its gains.
        let back = policy.act_vjp(&observation(rollout, n), &torque_bar)?;
        for (i, (q, v)) in back.q.iter().zip(&back.v).enumerate() {
            bars.q[(i, n)] += q;
            bars.v[(i, n)] += v;
        }
        direct
            .iter_mut()
            .zip(&back.gains)
            .for_each(|(g, b)| *g += b);
    }
    let through = rollout.vjp(&bars)?.gains;
    Ok(through.iter().zip(&direct).map(|(a, b)| a + b).collect())
}

/// What the controller saw at a step.
fn observation(rollout: &Rollout, step: usize) -> Observation<'_> {
    let sample = &rollout.samples()[step];
    Observation {
        step,
        time: sample.time,
        time_step: rollout.simulator().time_step(),
        q: &sample.q,
        v: &sample.v,
        mode: 0,
    }
}
