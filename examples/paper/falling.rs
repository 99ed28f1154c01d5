//! The falling ball: what figures 3 and 4 run.

use hydrograd::{Controls, Fidelity, Result, Rollout, Scene, Settings, Simulator};
use std::path::Path;

/// Height of the floor and radius of the sphere, m.
const FLOOR: f64 = -0.98;
const RADIUS: f64 = 0.6;

/// The scene file.
pub fn scene() -> Result<Scene> {
    Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/falling_ball.toml"))
}

/// A run; its own controller pushes the sphere and stops it.
pub fn run(scene: &Scene, fidelity: Fidelity, faces: usize, steps: usize) -> Result<Rollout> {
    let settings = Settings::default().fidelity(fidelity).faces(faces);
    let simulator = Simulator::new(scene, settings)?;
    simulator.rollout(&Controls::zeros(&simulator, steps))
}

/// Against time (s), of each state: how far the coin was pushed (m), its angle from lying flat (degrees), its height and the sphere's over the floor (m).
pub struct Coin {
    pub time: Vec<f64>,
    pub pushed: Vec<f64>,
    pub angle: Vec<f64>,
    pub height: Vec<f64>,
    pub sphere: Vec<f64>,
    /// Of its centre, m/s.
    pub speed: Vec<f64>,
}

impl Coin {
    pub fn of(rollout: &Rollout) -> Self {
        let samples = rollout.samples();
        let of = |f: &dyn Fn(&hydrograd::simulate::Sample) -> f64| samples.iter().map(f).collect();
        Self {
            time: of(&|s| s.time),
            pushed: of(&|s| s.q[1] - samples[0].q[1]),
            angle: of(&|s| (s.q[3] - samples[0].q[3]).to_degrees()),
            height: of(&|s| s.q[2] - FLOOR),
            sphere: of(&|s| s.q[0] - RADIUS - FLOOR),
            speed: of(&|s| s.v[1].hypot(s.v[2])),
        }
    }
}

/// The largest of numbers.
pub fn largest(x: &[f64]) -> f64 {
    x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}
