//! What quadratic drag costs each integrator: one body of 1,280 faces, `isolated`, as a ratio to a step of RK2 in the same run.
//!
//! `cargo bench --bench drag`. Integrators take turns, and the least of all rounds counts.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Scene, Shape};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use std::time::Instant;

const STEPS: usize = 100;
const ROUNDS: usize = 15;

fn scene(quadratic: f64) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let body = Body::new(Shape::ellipsoid([0.3, 0.2, 0.1]).faces(1280)).density(1500.0);
    scene.add(body.drag(Drag {
        quadratic,
        quadratic_part: DragPart::Total,
        ..Drag::default()
    }));
    scene.initial.v = vec![1.0, 0.2, -0.3, 0.4, 1.0, -0.6];
    scene
}

/// Seconds of a step, forward and of a rollout with its gradient.
fn seconds(simulator: &Simulator) -> hydrograd::Result<[f64; 2]> {
    let controls = Controls::zeros(simulator, STEPS);
    let start = Instant::now();
    let rollout = simulator.rollout(&controls)?;
    let forward = start.elapsed().as_secs_f64();
    rollout.gradient(&objective::final_velocity(0, 0.0, 1.0))?;
    let whole = start.elapsed().as_secs_f64();
    Ok([forward, whole].map(|s| s / STEPS as f64))
}

fn main() -> hydrograd::Result<()> {
    let integrators = [
        (Integrator::Rk2, "RK2"),
        (Integrator::Rk4, "RK4"),
        (Integrator::MomentumEuler, "momentum Euler"),
        (Integrator::EnergyEuler, "energy Euler"),
        (Integrator::Midpoint, "midpoint"),
        (Integrator::VelocityEuler, "velocity Euler"),
    ];
    println!(
        "| drag | integrator | µs a step | of RK2's | with gradient, of RK2's |\n|---|---|---|---|---|"
    );
    for (drag, name) in [(0.0, "none"), (0.8, "quadratic")] {
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let make = |(i, _)| Simulator::new(&scene(drag), settings.integrator(i));
        let simulators = integrators.into_iter().map(make);
        let simulators: Vec<Simulator> = simulators.collect::<hydrograd::Result<_>>()?;
        let mut least = vec![[f64::INFINITY; 2]; integrators.len()];
        for _ in 0..ROUNDS {
            for (simulator, least) in simulators.iter().zip(&mut least) {
                let now = seconds(simulator)?;
                *least = [0, 1].map(|k| least[k].min(now[k]));
            }
        }
        for ((_, integrator), [forward, whole]) in integrators.iter().zip(&least) {
            let [rk2, rk2_whole] = least[0];
            println!(
                "| {name} | {integrator} | {:.1} | {:.2} | {:.2} |",
                1e6 * forward,
                forward / rk2,
                whole / rk2_whole
            );
        }
    }
    Ok(())
}
