//! What a step takes, and the memory of the process: measured in one way by benches and by the example that makes the paper's table.

use hydrograd::{Controls, Simulator, objective};
use std::time::Instant;

/// How often it is measured.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Steps of a rollout.
    pub steps: usize,
    /// Rollouts that count; one more goes before them.
    pub repeat: usize,
}

/// Middle of the measured times.
pub fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

/// Peak resident memory of this process, MB; 0 where the system doesn't tell.
pub fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM"));
    let kb = line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1000.0
}

/// What a step takes.
pub struct StepTimes {
    /// Forward, s.
    pub forward: f64,
    /// Of a rollout with its gradient, forward pass included, s.
    pub gradient: f64,
    /// Most iterations of a solve.
    pub iterations: usize,
}

/// Medians over rollouts from the scene's start, nothing controlled.
pub fn step_times(simulator: &Simulator, effort: Effort) -> hydrograd::Result<StepTimes> {
    let controls = Controls::zeros(simulator, effort.steps);
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (mut forward, mut whole, mut iterations) = (vec![], vec![], 0);
    for i in 0..=effort.repeat {
        let start = Instant::now();
        let rollout = simulator.rollout(&controls)?;
        let middle = start.elapsed().as_secs_f64();
        rollout.gradient(&goal)?;
        if i > 0 {
            forward.push(middle / effort.steps as f64);
            whole.push(start.elapsed().as_secs_f64() / effort.steps as f64);
        }
        iterations = rollout.summary().iterations;
    }
    Ok(StepTimes {
        forward: median(forward),
        gradient: median(whole),
        iterations,
    })
}
