//! What `benches/overhead.py` compares Python with: the same rollouts and single steps in Rust.
//!
//! `cargo bench --bench overhead -- SCENE FIDELITY STEPS [SCENE FIDELITY STEPS …]` prints a line of JSON for each: seconds a step of a
//! rollout of so many steps with its gradient and without, and seconds of a single step; the least of some rounds.

use hydrograd::simulate::Fidelity;
use hydrograd::{Controls, Scene, Settings, Simulator, objective};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// As `benches/overhead.py` has it.
const ROUNDS: usize = 15;

fn seconds(mut call: impl FnMut() -> hydrograd::Result<()>) -> hydrograd::Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        call()?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least)
}

fn measure(scene: &str, fidelity: &str, steps: usize) -> Result<(), Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("examples/scenes/{scene}.toml"));
    let of = Scene::load(file)?;
    let fidelity: Fidelity = serde_json::from_value(fidelity.into())?;
    let simulator = Simulator::new(&of, Settings::for_scene(&of).fidelity(fidelity))?;
    let (many, one) = (
        Controls::zeros(&simulator, steps),
        Controls::zeros(&simulator, 1),
    );
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let rollout = seconds(|| simulator.rollout(&many).map(drop))?;
    let gradient = seconds(|| simulator.rollout(&many)?.gradient(&goal).map(drop))?;
    let step = seconds(|| {
        let mut state = simulator.initial()?;
        for _ in 0..steps {
            let made = simulator.rollout_from(&state, &one, |_| ControlFlow::Continue(()))?;
            state = made.states()[1].clone();
        }
        Ok(())
    })?;
    let per = |total: f64| total / steps as f64;
    let line = serde_json::json!({
        "rollout": per(rollout), "gradient": per(gradient), "step": per(step)
    });
    println!("{line}");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let wanted: Vec<&String> = arguments.iter().filter(|a| *a != "--bench").collect();
    for case in wanted.chunks_exact(3) {
        measure(case[0], case[1], case[2].parse()?)?;
    }
    Ok(())
}
