//! How the cost of a step grows with the bodies: where all feel each other, by products and by the factor; and where none feels another (`isolated`), free ones, and one chain of
//! revolute joints, as a ratio to 25 bodies in the same run.
//!
//! `cargo bench --bench bodies [-- coupled|isolated] [spheres] [ellipsoids] [boxes] [fish] [gpu] [MOST]`, MOST the largest number of bodies that feel each other (4096), `gpu` (with the feature of that name) with sums on a device; `-- errors [N]` compares N random configurations (100) with the
//! factor. The least of all rounds counts of isolated bodies. Preparing is one body's, whose shape the others share, and the checks of the scene.

mod coupled;

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use std::time::Instant;

const STEPS: usize = 20;
const ROUNDS: usize = 3;
const BODIES: [usize; 6] = [25, 50, 100, 200, 400, 800];

/// Spheres on a line, each free or hanging on the one before it.
fn scene(bodies: usize, chained: bool) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    for b in 0..bodies {
        let body = Body::new(Shape::sphere(0.04).faces(320)).density(1500.0);
        let mut body = match chained {
            false => body.at([0.2 * b as f64, 0.0, 0.0]),
            true => body.at([0.1 * f64::from(u8::from(b > 0)), 0.0, 0.0]),
        };
        if chained {
            body = body.joint(Joint::Revolute {
                axis: [0.0, 1.0, 0.0],
            });
            if b > 0 {
                body.parent = Some(format!("body {}", b - 1));
            }
        }
        scene.add(body);
    }
    scene
}

/// Milliseconds: to prepare the scene, a step, and a step of a rollout with its gradient.
fn milliseconds(
    bodies: usize,
    chained: bool,
    integrator: Integrator,
) -> hydrograd::Result<[f64; 3]> {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(integrator);
    let start = Instant::now();
    let simulator = Simulator::new(&scene(bodies, chained), settings)?;
    let prepared = start.elapsed().as_secs_f64();
    let controls = Controls::zeros(&simulator, STEPS);
    let mut least = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let rollout = simulator.rollout(&controls)?;
        least[0] = least[0].min(start.elapsed().as_secs_f64());
        rollout.gradient(&objective::final_velocity(0, 0.0, 1.0))?;
        least[1] = least[1].min(start.elapsed().as_secs_f64());
    }
    let [forward, whole] = least.map(|s| s / STEPS as f64);
    Ok([prepared, forward, whole].map(|s| 1e3 * s))
}

fn main() -> hydrograd::Result<()> {
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let number = given.iter().find_map(|a| a.parse().ok());
    let asked = |name: &str| given.iter().any(|a| a == name);
    if asked("errors") {
        return coupled::errors(number.unwrap_or(100) as u64);
    }
    if !asked("isolated") {
        coupled::iterations()?;
        let kinds = coupled::KINDS.iter().any(|(_, name)| asked(name));
        coupled::sizes(number.unwrap_or(4096), |kind| !kinds || asked(kind))?;
    }
    if !asked("coupled") {
        isolated()?;
    }
    Ok(())
}

fn isolated() -> hydrograd::Result<()> {
    let kinds = [
        (false, Integrator::Rk4, "free, RK4", 800),
        (true, Integrator::Rk4, "a chain, RK4", 800),
        (
            false,
            Integrator::MomentumEuler,
            "free, momentum Euler",
            800,
        ),
    ];
    println!(
        "\n| bodies | | ms to prepare | ms a step | of 25 bodies' | ms with gradient | of 25 bodies' |\n|---|---|---|---|---|---|---|"
    );
    for (chained, integrator, name, most) in kinds {
        let mut first = None;
        for bodies in BODIES.into_iter().filter(|b| *b <= most) {
            let now = milliseconds(bodies, chained, integrator)?;
            let [_, forward, whole] = *first.get_or_insert(now);
            println!(
                "| {bodies} | {name} | {:.1} | {:.3} | {:.1} | {:.3} | {:.1} |",
                now[0],
                now[1],
                now[1] / forward,
                now[2],
                now[2] / whole
            );
        }
    }
    Ok(())
}
