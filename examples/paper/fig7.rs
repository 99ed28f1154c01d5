//! Figure 7: a neutrally buoyant cube that is pushed and let go, without drag, with that of Eq. 22, and with the quadratic drag of its frontal area that models by bodies alone use.
//!
//! Each of the three has a solution in closed form, as the cube goes straight: beside it stand the figures.

use crate::plot::{Curve, Panel, draw};
use crate::{How, Made, Numbers};
use hydrograd::scene::{Drag, DragPart};
use hydrograd::{Controls, Fidelity, Scene, Settings, Simulator};
use nalgebra::DVector;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// νρ of Eq. 22 as the falling ball has it, kg/(m² s).
const LINEAR: f64 = 12.0;
/// Drag coefficient of a cube's frontal area.
const FRONTAL: f64 = 1.05;
/// Edge, m, and the speed at the start, m/s.
const EDGE: f64 = 0.2;
const SPEED: f64 = 0.5;

pub fn make(how: &How) -> Made {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/cube.toml");
    let scene = Scene::load(&file)?;
    let (faces, steps) = if how.quick { (192, 300) } else { (768, 2000) };
    let mut numbers = Numbers::new();
    let (mut ways, mut energies) = (Vec::new(), Vec::new());
    for (name, drag) in [
        ("none", Drag::default()),
        (
            "eq22",
            Drag {
                linear: LINEAR,
                ..Drag::default()
            },
        ),
        (
            "frontal",
            Drag {
                quadratic_part: DragPart::Normal,
                // Front and back both count as faces that the water meets: half each.
                quadratic: 0.5 * FRONTAL,
                ..Drag::default()
            },
        ),
    ] {
        let mut scene = scene.clone();
        scene.bodies[0].drag = Some(drag);
        let settings = Settings::default()
            .fidelity(Fidelity::Isolated)
            .faces(faces);
        let simulator = Simulator::new(&scene, settings)?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
        let seconds = start.elapsed().as_secs_f64() / steps as f64;
        let samples = rollout.samples();
        let of = |f: &dyn Fn(&hydrograd::simulate::Sample) -> f64| -> Vec<f64> {
            samples.iter().map(f).collect()
        };
        let (time, way) = (of(&|s| s.time), of(&|s| s.q[2] - samples[0].q[2]));
        let energy = of(&|s| s.kinetic_energy / samples[0].kinetic_energy);
        let end = &samples[steps];
        let inertia = simulator.equations(&samples[0].q)?.mass_matrix()?[(2, 2)];
        let exact = exact(name, inertia, scene.fluid.density, end.time);
        numbers.insert(
            name.into(),
            json!({
                "way_m": way[steps],
                "way_in_closed_form_m": exact,
                "off_by": (way[steps] - exact).abs() / exact,
                "speed_lost": 1.0 - end.v[2] / SPEED,
                "energy_left": energy[steps],
                "aside_m": DVector::from_column_slice(&[end.q[0], end.q[1]]).norm(),
                "seconds_a_step": seconds,
                "after_s": end.time,
            }),
        );
        let label = match name {
            "none" => "no drag",
            "eq22" => "Eq. 22",
            _ => "frontal area",
        };
        ways.push(Curve::new(label, &time, &way));
        energies.push(Curve::new(label, &time, &energy));
    }
    draw(
        how.picture,
        &[
            Panel::new("way of the cube, m", ways),
            Panel::new("energy left, of that at the start", energies),
        ],
    )?;
    Ok(numbers)
}

/// Way after a time (s) of a body of this inertia (kg, the water's part included).
fn exact(drag: &str, inertia: f64, density: f64, time: f64) -> f64 {
    match drag {
        "none" => SPEED * time,
        "eq22" => {
            // Along the four sides.
            let rate = LINEAR * 4.0 * EDGE * EDGE / inertia;
            SPEED / rate * -(-rate * time).exp_m1()
        }
        _ => {
            let per_metre = 0.5 * density * FRONTAL * EDGE * EDGE / inertia;
            (SPEED * per_metre * time).ln_1p() / per_metre
        }
    }
}
