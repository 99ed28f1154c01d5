//! What `benches/overhead.py` compares Python with: the same rollouts and single steps in Rust.
//!
//! `cargo bench --bench overhead -- SCENE FIDELITY STEPS` measures once for every line that it reads, so that both sides can take turns, and
//! answers with a line of JSON: seconds a step of a rollout of so many steps, of one with its gradient, and of a single step.

use hydrograd::simulate::Fidelity;
use hydrograd::{Controls, Scene, Settings, Simulator, objective};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Seconds of a call.
fn seconds(call: impl FnOnce() -> hydrograd::Result<()>) -> hydrograd::Result<f64> {
    let start = Instant::now();
    call()?;
    Ok(start.elapsed().as_secs_f64())
}

fn measure(simulator: &Simulator, steps: usize) -> hydrograd::Result<serde_json::Value> {
    let many = Controls::zeros(simulator, steps);
    let one = Controls::zeros(simulator, 1);
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
    Ok(serde_json::json!({ "rollout": per(rollout), "gradient": per(gradient), "step": per(step) }))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let wanted: Vec<&String> = arguments.iter().filter(|a| *a != "--bench").collect();
    let [scene, fidelity, steps] = wanted.as_slice() else {
        return Ok(());
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("examples/scenes/{scene}.toml"));
    let scene = Scene::load(file)?;
    let fidelity: Fidelity = serde_json::from_value(fidelity.as_str().into())?;
    let settings = Settings::default().fidelity(fidelity);
    let simulator = Simulator::new(&scene, settings)?;
    for line in std::io::stdin().lines() {
        line?;
        println!("{}", measure(&simulator, steps.parse()?)?);
    }
    Ok(())
}
