//! Grasps that nobody tuned: object, fingers and friction drawn by a seed, one set of settings for all, with either gripper.

mod hinged;
mod sliding;

use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{Grasp, GraspSettings, GraspTask, grasp};
use hydrograd::simulate::Fidelity;
use hydrograd::{Result, Scene, Settings, Simulator};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// A gripper with what it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gripper {
    /// Fingers that slide on a column, and a coin: `grasp.toml`.
    Sliding,
    /// Fingers hinged under a palm, over the floor, and a pebble, a box or a block of a mesh: `gripper.toml`.
    Hinged,
}

impl Gripper {
    /// By its name on the command line.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "sliding" => Some(Self::Sliding),
            "hinged" => Some(Self::Hinged),
            _ => None,
        }
    }

    fn scene(self) -> Result<Scene> {
        let file = match self {
            Self::Sliding => "grasp.toml",
            Self::Hinged => "gripper.toml",
        };
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
        Scene::load(folder.join(file))
    }

    /// A task: the scene with what was drawn in it.
    fn draw(self, scene: &Scene, random: &mut Samples) -> Result<Task> {
        match self {
            Self::Sliding => sliding::draw(scene, random),
            Self::Hinged => hinged::draw(scene, random),
        }
    }
}

/// What is drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Drawn {
    /// What lies between the fingers.
    pub kind: &'static str,
    /// Half its extent along its axes, m.
    pub half: [f64; 3],
    /// Angle at the start, rad.
    pub tilt: f64,
    /// kg/m³
    pub density: f64,
    pub friction: f64,
    /// Of the fingers, m.
    pub length: f64,
}

/// A drawn grasp.
pub struct Task {
    pub drawn: Drawn,
    pub scene: Scene,
    pub task: GraspTask,
}

/// Outcome of a drawn grasp.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    pub drawn: Drawn,
    #[serde(flatten)]
    pub found: Grasp,
    /// From the scene to the found forces, s.
    pub seconds: f64,
}

/// Finds one grasp.
fn one(drawn: Task) -> Result<Outcome> {
    let start = Instant::now();
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let simulator = Simulator::new(&drawn.scene, settings)?;
    let settings = GraspSettings::default();
    Ok(Outcome {
        drawn: drawn.drawn,
        found: grasp(&simulator, &drawn.task, &settings, |_, _| {})?,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// So many grasps, drawn by a seed.
pub fn run(gripper: Gripper, count: usize, seed: u64) -> Result<Vec<Outcome>> {
    let scene = gripper.scene()?;
    let mut random = Samples::new(seed);
    (0..count)
        .map(|i| {
            let outcome = one(gripper.draw(&scene, &mut random)?)?;
            let found = &outcome.found;
            eprintln!(
                "grasp {}: {} by {:?}, cost {:.3}, {} of the pushes, {} simulations, {} gradients, {} failed, {:.1} s",
                i + 1,
                if found.caught { "caught" } else { "lost" },
                found.stage,
                found.cost,
                found.pushes_caught,
                found.simulations,
                found.gradients,
                found.failures,
                outcome.seconds
            );
            Ok(outcome)
        })
        .collect()
}
