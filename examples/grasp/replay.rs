//! The found trajectory again with the coupled equations of all bodies, on meshes that resolve the gap at which surfaces touch.

use crate::hold;
use crate::task;
use hydrograd::{Result, Scene};
use serde::Serialize;
use std::time::Instant;

/// Outcome of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Replay {
    pub caught: bool,
    /// Since when the coin is held, s.
    pub held_since: Option<f64>,
    pub faces: usize,
    pub seconds_per_step: f64,
    /// What the run has to say.
    pub warnings: Vec<String>,
}

/// Runs a scene with its own controller.
pub fn full(scene: &Scene) -> Result<Replay> {
    let simulator = task::simulator(scene, task::FULL)?;
    let start = Instant::now();
    let rollout = task::run(&simulator, scene.steps)?;
    Ok(Replay {
        caught: hold::caught(&rollout)?,
        held_since: hold::held_since(&rollout)?,
        faces: simulator.faces(),
        seconds_per_step: start.elapsed().as_secs_f64() / scene.steps as f64,
        warnings: rollout.warnings(),
    })
}
