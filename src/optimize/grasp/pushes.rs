//! Pushes to start from: what a person would try.
//!
//! A push closes the gripper with a part of its limits for a while, lets it glide, and then grips; the other controls push meanwhile in one direction and
//! then brake. Five numbers in [0, 1) say how, spread evenly by the additive sequence of the generalised golden ratio.

use super::cost::GRIP;
use super::task::{GraspTask, Grip};
use crate::Result;
use crate::simulate::{Controls, Simulator};
use nalgebra::DMatrix;

/// Part of the limits with which a push closes: from, to.
const CLOSING: [f64; 2] = [0.15, 0.95];
/// Part of the run that a push lasts.
const PUSHING: [f64; 2] = [0.05, 0.6];
/// Part of the run after which it grips.
const GRIPPING: [f64; 2] = [0.4, 0.8];
/// The root of φ⁶ = φ + 1.
const GOLDEN: f64 = 1.134_724_138_401_519_6;

/// Number `i` of a sequence that fills the unit cube evenly.
fn spread(i: usize) -> [f64; 5] {
    std::array::from_fn(|k| (0.5 + (i + 1) as f64 * GOLDEN.powi(-(k as i32 + 1))).fract())
}

fn between([low, high]: [f64; 2], part: f64) -> f64 {
    low + (high - low) * part
}

impl GraspTask {
    /// The push in the middle of those that [`super::grasp`] tries: it closes with half of the limits for a third of the run, and grips
    /// at 0.6 of it; nothing else acts. What other ways to find a grasp may start from.
    ///
    /// # Errors
    /// As [`GraspTask::hold_cost`].
    pub fn middle_push(&self, simulator: &Simulator) -> Result<Controls> {
        push_with(simulator, &Grip::new(simulator, self)?, [0.5; 5])
    }
}

/// Push number `i`.
pub(super) fn push(simulator: &Simulator, grip: &Grip, i: usize) -> Result<Controls> {
    push_with(simulator, grip, spread(i))
}

fn push_with(simulator: &Simulator, grip: &Grip, numbers: [f64; 5]) -> Result<Controls> {
    let steps = simulator.steps();
    let [strength, length, moment, follow, stop] = numbers;
    let strength = between(CLOSING, strength);
    let pushing = between(PUSHING, length);
    let gripping = between(GRIPPING, moment).max(pushing);
    // As far one way as the other, and a third of them not at all.
    let follow = match 3.0 * follow - 1.5 {
        x if x.abs() < 0.5 => 0.0,
        x => (x.abs() - 0.5) * x.signum(),
    };
    let brake = -stop * follow;
    let matrix = DMatrix::from_fn(grip.limits.len(), steps, |c, n| {
        let at = n as f64 / steps as f64;
        let part = match grip.closing[c] {
            0.0 if at < pushing => 0.0,
            0.0 if at < gripping => follow,
            0.0 if at < 0.5 * (1.0 + gripping) => brake,
            0.0 => 0.0,
            closing if at < pushing => strength * closing,
            _ if at < gripping => 0.0,
            closing => GRIP * closing,
        };
        part * grip.limits[c]
    });
    Controls::from_matrix(simulator, matrix)
}
