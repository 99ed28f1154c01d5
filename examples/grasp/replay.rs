//! The found trajectory again with the coupled equations of all bodies, on meshes that resolve the gap at which surfaces touch.

use crate::hold;
use crate::task;
use hydrograd::simulate::Fidelity;
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
    /// Longest edge where surfaces come near one another, m.
    pub edge: f64,
    pub seconds_per_step: f64,
    /// What the run has to say.
    pub warnings: Vec<String>,
}

/// Where the coin comes near a finger, in the finger's frame, and how far around, m.
const NEAR: ([f64; 3], f64) = ([0.0, 1.3, 0.0], 0.2);

/// Runs a scene with its own controller, its meshes refined where surfaces come near one another.
pub fn full(scene: &Scene) -> Result<Replay> {
    let mut scene = scene.clone();
    let edge = 2.0 * scene.contact.and_then(|c| c.gap).unwrap_or(0.0);
    for body in &mut scene.bodies {
        let (center, radius) = match body.name.as_str() {
            "finger 1" | "finger 2" => NEAR,
            // All of it.
            "coin" => ([0.0; 3], 0.3),
            _ => continue,
        };
        *body = body.clone().refine(center, radius, edge);
    }
    let simulator = task::simulator(&scene, Fidelity::Full)?;
    let start = Instant::now();
    let rollout = task::run(&simulator, scene.steps)?;
    Ok(Replay {
        caught: hold::caught(&rollout)?,
        held_since: hold::held_since(&rollout)?,
        faces: simulator.faces(),
        edge,
        seconds_per_step: start.elapsed().as_secs_f64() / scene.steps as f64,
        warnings: rollout.warnings(),
    })
}
