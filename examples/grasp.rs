//! An underwater grasp, found by gradients.
//!
//! A gripper closes on a coin as it would on dry land. There it catches it; under water the fingers press out the water between
//! them, and the coin with it, and close behind it. Descending the gradient of the whole trajectory, contact and water included, finds
//! forces that catch it.
//!
//! The descent has two stages, because a trajectory through a collision is a rugged thing to descend: first the approach alone, to
//! where the coin lies well between the fingers before they touch it; from there the whole trajectory, to a coin that is held.
//!
//! ```text
//! cargo run --release --example grasp -- --random N [--gripper sliding|hinged] [--seed S] [--rival] [--json]
//! cargo run --release --example grasp -- --random N --descents [--gripper sliding|hinged] [--seed S] [--json]
//! cargo run --release --example grasp -- [--json] [--out FOLDER] [--check N] [--replay full] [--rival-seeds N] [--rival-cap N] [--no-rival]
//! ```
//!
//! Into the folder go the found trajectory as CSV and JSON, the scene with the found forces as its controller (`grasp_caught.toml`, to be run
//! again with any fidelity), and a picture. `--check N` compares the water's mass matrix at N of its states with that of coupled panels; `--replay full` runs it with the coupled equations of all
//! bodies; both on meshes fine enough for the gap. The rival is CMA-ES with the same cost, start and knots.
//!
//! `--random N` catches N coins that nobody tuned for ([`random`]): coin, friction and fingers are drawn by a seed, the settings are those of
//! [`hydrograd::optimize::grasp`] for all. With `--rival` CMA-ES then tries each of them with ten times the simulations, from the push in the middle
//! of those that the recipe tries, until it catches; `--descents` compares plain, softened and smoothed descents from there instead.

#[path = "grasp/check.rs"]
mod check;
#[path = "grasp/hold.rs"]
mod hold;
#[path = "grasp/plot.rs"]
mod plot;
#[path = "grasp/random/mod.rs"]
mod random;
#[path = "grasp/replay.rs"]
mod replay;
#[path = "grasp/rival.rs"]
mod rival;
#[path = "grasp/task.rs"]
mod task;

use hydrograd::optimize::OptimizeProgress;
use hydrograd::scene::Controller;
use hydrograd::simulate::{Recording, Rollout};
use hydrograd::{Controls, Scene};
use serde::Serialize;
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use task::{Spent, Task};

/// What the command line asks for.
struct Options {
    json: bool,
    out: PathBuf,
    /// States of which the mass matrix is checked.
    check: usize,
    replay: bool,
    /// Whether CMA-ES has a try; by default at the one grasp, not at random ones.
    rival: Option<bool>,
    /// Ways to descend on random grasps instead.
    descents: bool,
    seeds: usize,
    /// Most simulations of a rival; none: eleven times those of the descent.
    cap: Option<usize>,
    /// Random grasps instead.
    random: Option<usize>,
    gripper: random::Gripper,
    seed: u64,
}

#[derive(Serialize)]
struct Report {
    /// The naive push without water.
    naive_dry_caught: bool,
    /// The naive push in water.
    naive_caught: bool,
    /// The paper's two hand-tuned controllers in water, for the last half second.
    hand_tuned_caught: [bool; 2],
    /// Since when they hold the coin at the end, s; null if they don't.
    hand_tuned_held_since: [Option<f64>; 2],
    optimised_caught: bool,
    /// Since when the coin is held, s.
    optimised_held_since: Option<f64>,
    /// Iterations of both descents.
    iterations: usize,
    /// Simulations that the descents cost, gradients counted by their time over a simulation's.
    simulations: f64,
    /// Rollouts with gradients, shorter ones by their share.
    rollouts: f64,
    /// Wall time from the scene to the found forces, s.
    seconds: f64,
    /// Time of a simulation, s.
    seconds_per_simulation: f64,
    /// Time of a gradient, its simulation included, s.
    seconds_per_gradient: f64,
    cost_naive: f64,
    cost_optimised: f64,
    /// The water's mass matrix beside that of coupled panels, with `--check`.
    check: Vec<check::Compared>,
    /// The same trajectory with `full`; null without `--replay full`.
    replay: Option<replay::Replay>,
    /// Median of what the rival needed for the same cost; a lower bound where `rival.at_least`.
    rival_simulations: Option<usize>,
    /// Over the descent's with the same faces.
    rival_ratio: Option<f64>,
    rival: Option<rival::Rival>,
    warnings: Vec<String>,
    files: Vec<PathBuf>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    if let Some(count) = options.random {
        return several(count, &options);
    }
    Recording::prepare(&options.out)?;
    let start = Instant::now();
    let plain = task::load()?;
    let scene = task::refined(&plain);

    let dry = task::simulator(&task::dry(&plain), task::CHEAP)?;
    let naive_dry_caught = hold::caught(&task::run(&dry, scene.steps)?)?;
    let submerged = task::simulator(&scene, task::RESOLVED)?;
    let naive = task::run(&submerged, scene.steps)?;
    let naive_caught = hold::caught(&naive)?;

    // Found with the faces of the scene, and polished with those that resolve the gaps of the grip.
    let coarse = Task::new(&plain, task::CHEAP)?;
    let x = coarse.through(&naive)?;
    let coarsely = coarse.find(&x, say)?;
    let task = Task::new(&scene, task::RESOLVED)?;
    let cost_naive = task.hold(&x)?.0;
    let found = task.polish(&coarsely.x, |p| say("resolved", p))?;
    let spent = coarse.spent().and(&task.spent());
    let optimised = task.rollout(&found.x)?;
    let optimised_held_since = hold::held_since(&optimised)?;
    let optimised_caught = hold::caught(&optimised)?;
    let seconds = start.elapsed().as_secs_f64();

    let mut hand_tuned_caught = [false; 2];
    let mut hand_tuned_held_since = [None; 2];
    for (k, tuned) in task::hand_tuned(&scene).iter().enumerate() {
        let simulator = task::simulator(tuned, task::RESOLVED)?;
        let rollout = task::run(&simulator, scene.steps)?;
        hand_tuned_caught[k] = hold::caught(&rollout)?;
        hand_tuned_held_since[k] = hold::held_since(&rollout)?;
    }

    let replayable = playback(&scene, &task.controls(&found.x)?);
    let mut files: Vec<PathBuf> = Recording::of(&scene, &optimised)?
        .write(&options.out)?
        .into();
    let text = options.out.join("grasp_caught.toml");
    std::fs::write(&text, replayable.to_toml()?)?;
    let picture = options.out.join("grasp.svg");
    plot::draw(&picture, &[("naive", &naive), ("optimised", &optimised)])?;
    files.extend([text, picture]);

    let check = match options.check {
        0 => Vec::new(),
        count => check::along(&scene, &optimised, count)?,
    };
    let replay = match options.replay {
        true => Some(replay::full(&replayable)?),
        false => None,
    };
    let simulations = equivalent(&spent);
    // The rival has the scene's own faces, and the cost that the descent reached on them.
    let compared = equivalent(&coarse.spent());
    let cap = options.cap.unwrap_or((11.0 * compared).ceil() as usize);
    let rival = match options.rival.unwrap_or(true) {
        true => Some(rival::run(&plain, &x, coarsely.cost, cap, options.seeds)?),
        false => None,
    };
    let report = Report {
        naive_dry_caught,
        naive_caught,
        hand_tuned_caught,
        hand_tuned_held_since,
        optimised_caught,
        optimised_held_since,
        iterations: coarsely.iterations + found.iterations,
        simulations,
        rollouts: spent.gradients,
        seconds,
        seconds_per_simulation: spent.seconds_per_simulation,
        seconds_per_gradient: spent.seconds_per_simulation + spent.seconds_per_gradient,
        cost_naive,
        cost_optimised: found.cost,
        check,
        replay,
        rival_simulations: rival.as_ref().map(|r| r.median),
        rival_ratio: rival.as_ref().map(|r| r.median as f64 / compared),
        rival,
        warnings: optimised.warnings(),
        files,
    };
    match options.json {
        true => println!("{}", serde_json::to_string(&report)?),
        false => print(&report, &optimised),
    }
    Ok(())
}

/// Grasps that are drawn by a seed.
fn several(count: usize, options: &Options) -> Result<(), Box<dyn Error>> {
    if options.descents {
        let found = random::descents::compare(options.gripper, count, options.seed)?;
        match options.json {
            true => println!("{}", serde_json::to_string(&found)?),
            false => random::descents::print(&found),
        }
        return Ok(());
    }
    let start = Instant::now();
    let rival = options.rival.unwrap_or(false);
    let found = random::run(options.gripper, count, options.seed, rival)?;
    if options.json {
        println!("{}", serde_json::to_string(&found)?);
        return Ok(());
    }
    if rival {
        random::print(&found);
    }
    let caught = found.iter().filter(|o| o.found.caught).count();
    println!(
        "{caught} of {count} caught, {:.0} s",
        start.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Simulations that would have taken as long.
fn equivalent(spent: &Spent) -> f64 {
    spent.simulations + spent.gradients * spent.seconds_per_gradient / spent.seconds_per_simulation
}

/// The scene with the found forces as its controller.
fn playback(scene: &Scene, controls: &Controls) -> Scene {
    let mut scene = scene.clone();
    scene.name = "grasp, caught".into();
    let columns = controls.matrix().column_iter();
    scene.controller = Some(Controller::Playback {
        control: columns.map(|c| c.as_slice().to_vec()).collect(),
    });
    scene
}

fn say(stage: &str, p: &OptimizeProgress) {
    eprintln!(
        "{stage}, iteration {:2}: cost {:.4}, |gradient| {:.2e}, {} rollouts with gradient",
        p.iteration, p.cost, p.gradient, p.evaluations
    );
}

fn print(r: &Report, optimised: &Rollout) {
    let word = |caught: bool| if caught { "caught" } else { "lost" };
    println!("naive push without water: {}", word(r.naive_dry_caught));
    println!("naive push in water: {}", word(r.naive_caught));
    for (k, (caught, since)) in
        (r.hand_tuned_caught.iter().zip(&r.hand_tuned_held_since)).enumerate()
    {
        let since = since.map_or("not held".into(), |t| format!("held since {t:.2} s"));
        println!(
            "hand-tuned controller {}: {} ({since})",
            k + 2,
            word(*caught)
        );
    }
    println!(
        "optimised: {} (held since {:.2} s of {:.2} s), cost {:.1} -> {:.3}",
        word(r.optimised_caught),
        r.optimised_held_since.unwrap_or(f64::NAN),
        optimised.samples()[optimised.steps()].time,
        r.cost_naive,
        r.cost_optimised
    );
    println!(
        "{} iterations, {:.1} rollouts with gradients = {:.0} simulations, {:.1} s",
        r.iterations, r.rollouts, r.simulations, r.seconds
    );
    for c in &r.check {
        println!(
            "t = {:.2} s, gap {:.1} mm: mass matrix of the water {:.2} % from coupled panels, the coin's {:.2} %",
            c.time,
            1e3 * c.gap,
            1e2 * c.error,
            1e2 * c.coin
        );
    }
    if let Some(replay) = &r.replay {
        println!(
            "replayed with full, {} faces: {}",
            replay.faces,
            word(replay.caught)
        );
    }
    if let (Some(rival), Some(ratio)) = (&r.rival, r.rival_ratio) {
        let bound = if rival.at_least { "at least " } else { "" };
        println!(
            "CMA-ES for the same cost: {bound}{} simulations, {bound}{ratio:.0} times as many",
            rival.median
        );
    }
    for w in &r.warnings {
        println!("warning: {w}");
    }
    for f in &r.files {
        println!("wrote {}", f.display());
    }
}

fn options() -> Result<Options, String> {
    let mut out = Options {
        json: false,
        out: "grasp".into(),
        check: 0,
        replay: false,
        rival: None,
        descents: false,
        seeds: 5,
        cap: None,
        random: None,
        gripper: random::Gripper::Sliding,
        seed: 1,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{name} needs a value"));
        let number = |text: String| text.parse().map_err(|_| format!("{text}: not a number"));
        match name.as_str() {
            "--json" => out.json = true,
            "--out" => out.out = value()?.into(),
            "--replay" => match value()?.as_str() {
                "full" => out.replay = true,
                other => return Err(format!("--replay {other}: expected full")),
            },
            "--check" => out.check = number(value()?)?,
            "--rival" => out.rival = Some(true),
            "--no-rival" => out.rival = Some(false),
            "--descents" => out.descents = true,
            "--random" => out.random = Some(number(value()?)?),
            "--gripper" => {
                let name = value()?;
                out.gripper = random::Gripper::named(&name)
                    .ok_or(format!("--gripper {name}: expected sliding or hinged"))?;
            }
            "--seed" => out.seed = number(value()?)? as u64,
            "--rival-seeds" => out.seeds = number(value()?)?,
            "--rival-cap" => out.cap = Some(number(value()?)?),
            _ => {
                return Err(format!(
                    "{name}: expected --random, --gripper, --seed, --rival, --descents, --json, --out, --check, --replay, --rival-seeds, --rival-cap or --no-rival"
                ));
            }
        }
    }
    if out.descents && out.random.is_none() {
        return Err("--descents compares random grasps: give --random N as well".into());
    }
    if out.rival != Some(false) && out.seeds == 0 {
        return Err("--rival-seeds must be at least 1".into());
    }
    Ok(out)
}
