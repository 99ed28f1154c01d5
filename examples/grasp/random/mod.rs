//! Grasps that nobody tuned: object, fingers and friction drawn by a seed, one set of settings for all, with either gripper.

pub mod descents;
mod hinged;
mod race;
mod sliding;
mod tried;

use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{Grasp, GraspSettings, GraspTask, grasp};
use hydrograd::{Result, Scene};
use rayon::prelude::*;
use serde::Serialize;
use std::ops::ControlFlow;
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
    /// CMA-ES on the same grasp, with `--rival`.
    pub rival: Option<race::Raced>,
}

/// Finds one grasp, in water that is resolved or cheap.
fn one(drawn: &Task, resolved: bool) -> Result<Outcome> {
    let start = Instant::now();
    let simulator = tried::simulator(drawn, resolved)?;
    let settings = GraspSettings::default();
    let on = |_, _| ControlFlow::Continue(());
    Ok(Outcome {
        drawn: drawn.drawn.clone(),
        found: grasp(&simulator, &drawn.task, &settings, on)?,
        seconds: start.elapsed().as_secs_f64(),
        rival: None,
    })
}

fn word(caught: bool) -> &'static str {
    if caught { "caught" } else { "lost" }
}

/// So many grasps, drawn by a seed; with a rival, which needs ten times the simulations, all in cheap water, and CMA-ES then tries each of them.
pub fn run(gripper: Gripper, count: usize, seed: u64, rival: bool) -> Result<Vec<Outcome>> {
    let scene = gripper.scene()?;
    let mut random = Samples::new(seed);
    let drawn: Result<Vec<Task>> = (0..count)
        .map(|_| gripper.draw(&scene, &mut random))
        .collect();
    let drawn = drawn?;
    let mut outcomes = Vec::new();
    for (i, task) in drawn.iter().enumerate() {
        let outcome = one(task, !rival)?;
        let found = &outcome.found;
        eprintln!(
            "grasp {}: {} by {:?}, cost {:.3}, {} of the pushes, {} simulations, {} gradients, {} failed, {:.1} s",
            i + 1,
            word(found.caught),
            found.stage,
            found.cost,
            found.pushes_caught,
            found.simulations,
            found.gradients,
            found.failures,
            outcome.seconds
        );
        outcomes.push(outcome);
    }
    if rival {
        let pairs = drawn.par_iter().zip(&mut outcomes).enumerate();
        pairs.try_for_each(|(i, (task, outcome))| -> Result<()> {
            let raced = race::race(task, outcome, seed)?;
            eprintln!(
                "grasp {}: CMA-ES {} after {} simulations of {}, cost {:.3}",
                i + 1,
                word(raced.caught),
                raced.simulations,
                raced.most,
                raced.cost
            );
            outcome.rival = Some(raced);
            Ok(())
        })?;
    }
    Ok(outcomes)
}

/// The table of recipe and rival.
pub fn print(all: &[Outcome]) {
    println!(
        "| grasp | recipe | by | cost | simulations (gradients by their time) | CMA-ES | simulations | cost |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (i, outcome) in all.iter().enumerate() {
        let Some(raced) = &outcome.rival else {
            continue;
        };
        println!(
            "| {} | {} | {:?} | {:.3} | {:.0} | {} | {} of {} | {:.3} |",
            i + 1,
            word(outcome.found.caught),
            outcome.found.stage,
            outcome.found.cost,
            raced.recipe,
            word(raced.caught),
            raced.simulations,
            raced.most,
            raced.cost
        );
    }
}
