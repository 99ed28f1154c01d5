//! What `auto` gains over one fixed setting for all bodies of a scene.
//!
//! `cargo bench --bench auto [-- --quick]`. On each scene `auto` at an aim of 1 %, and `reduced` over a grid of tolerances and
//! resolved gaps, the same for all bodies. The errors are of M_f at the start, max |ΔM_ij| / √(M_ii M_jj), against coupled panels on
//! two meshes, extrapolated. Its rival is the fastest of those that err no more.

#[allow(dead_code)]
mod common;

use common::reference::reference;
use common::support::felt_error;
use common::{Effort, added_mass, arguments, step_times};
use hydrograd::scene::{Placement, Shape};
use hydrograd::{Body, Fidelity, Fluid, Joint, Scene, Settings, Simulator};
use nalgebra::DMatrix;

/// Tolerances of the grid.
const TOLERANCES: [f64; 4] = [1e-2, 3e-3, 1e-3, 3e-4];
/// Resolved gaps of the grid, m; none leaves the default.
const GAPS: [Option<f64>; 5] = [None, Some(0.1), Some(0.05), Some(0.03), Some(0.02)];

fn main() -> hydrograd::Result<()> {
    let quick = arguments().iter().any(|a| a == "--quick");
    println!(
        "| scene | configuration | unknowns | ms/step | ms/step with gradient | error of M_f |"
    );
    println!("|---|---|---|---|---|---|");
    let mut notes = Vec::new();
    for (name, scene) in [("school", school()), ("boulders", boulders())] {
        // 320 and 720 faces a body, or 180 and 320.
        let meshes = if quick { [2.25, 4.0] } else { [4.0, 9.0] };
        let right = reference(&scene, meshes)?;
        notes.push(format!(
            "{name}: reference of {} faces, {:.1e} from that of fewer",
            right.faces, right.rest
        ));
        let measure = |settings: Settings| Measured::new(&scene, settings, &right.matrix, quick);
        let auto = measure(Settings::default().fidelity(Fidelity::Auto))?;
        auto.print(name, "`auto` (1 %)");
        let mut best: Option<(String, Measured)> = None;
        for tolerance in TOLERANCES {
            for gap in GAPS {
                let settings = Settings {
                    resolved_gap: gap,
                    ..Settings::default()
                        .fidelity(Fidelity::Reduced)
                        .accuracy(tolerance)
                };
                let Ok(found) = measure(settings) else {
                    continue;
                };
                let gap = gap.map_or("default".into(), |g| format!("{g} m"));
                let label = format!("`reduced`, tolerance {tolerance:.0e}, resolved gap {gap}");
                if !quick {
                    found.print("", &label);
                }
                let better = best
                    .as_ref()
                    .is_none_or(|(_, b)| found.times[0] < b.times[0]);
                if found.error <= auto.error && better {
                    best = Some((label, found));
                }
            }
        }
        notes.push(match best {
            Some((label, b)) => format!(
                "{name}: the fastest that errs no more is {label}: {:.2} × the time of `auto` per step, {:.2} × with gradient",
                b.times[0] / auto.times[0],
                b.times[1] / auto.times[1]
            ),
            None => format!("{name}: no fixed setting errs so little"),
        });
    }
    println!();
    notes.iter().for_each(|n| println!("- {n}"));
    Ok(())
}

struct Measured {
    unknowns: usize,
    /// Forward, and with gradient; s a step.
    times: [f64; 2],
    error: f64,
}

impl Measured {
    fn new(
        scene: &Scene,
        settings: Settings,
        right: &DMatrix<f64>,
        quick: bool,
    ) -> hydrograd::Result<Self> {
        let simulator = Simulator::new(scene, settings)?;
        let effort = match quick {
            true => Effort {
                steps: 3,
                repeat: 1,
            },
            false => Effort {
                steps: 20,
                repeat: 5,
            },
        };
        let times = step_times(&simulator, effort)?;
        Ok(Self {
            unknowns: simulator.unknowns(),
            error: felt_error(&added_mass(&simulator)?, right),
            times: [times.forward, times.gradient],
        })
    }

    fn print(&self, scene: &str, label: &str) {
        println!(
            "| {scene} | {label} | {} | {:.2} | {:.2} | {:.1e} |",
            self.unknowns,
            1e3 * self.times[0],
            1e3 * self.times[1],
            self.error
        );
    }
}

fn free(scene: &mut Scene, shape: Shape, place: [f64; 3], turn: [f64; 3]) {
    let mut body = Body::new(shape).density(1100.0);
    body.placement = Placement::new(place, turn);
    body.joint = Joint::Free;
    scene.add(body);
}

/// Places on a grid with `spacing` (m), shaken by up to a twentieth of it.
fn strewn(count: usize, spacing: f64) -> Vec<[f64; 3]> {
    let shaken = |at: usize, i: usize, k: usize| {
        let shift = ((7 * i + 3 * k) % 5) as f64 - 2.0;
        spacing * (at as f64 + 0.025 * shift)
    };
    let place = |i: usize| {
        [
            shaken(i % 3, i, 0),
            shaken((i / 3) % 3, i, 1),
            shaken(i / 9, i, 2),
        ]
    };
    (1..=count).map(place).collect()
}

/// Sixteen ellipsoids like fish, 0.6 m long, three lengths apart, but for two that swim side by side 3 cm apart.
fn school() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let fish = || Shape::ellipsoid([0.3, 0.1, 0.15]).faces(80);
    free(&mut scene, fish(), [0.0; 3], [0.0; 3]);
    free(&mut scene, fish(), [0.05, 0.23, 0.0], [0.0; 3]);
    for (i, place) in strewn(14, 1.8).into_iter().enumerate() {
        free(&mut scene, fish(), place, [0.0, 0.0, 0.1 * i as f64]);
    }
    scene
}

/// Sixteen balls of 0.1 to 0.2 m radius, two of them 2 cm apart, the others strewn about 1 m apart.
fn boulders() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = |radius| Shape::sphere(radius).faces(80);
    free(&mut scene, ball(0.1), [0.0; 3], [0.0; 3]);
    free(&mut scene, ball(0.1), [0.22, 0.0, 0.0], [0.0; 3]);
    for (i, place) in strewn(14, 1.0).into_iter().enumerate() {
        let radius = 0.1 + 0.025 * ((3 * i) % 5) as f64;
        free(&mut scene, ball(radius), place, [0.0; 3]);
    }
    scene
}
