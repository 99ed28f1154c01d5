//! The falling ball with coupled water and without, side by side.
//!
//! A heavy sphere is driven down beside a coin that lies flat above the sea floor. With the fidelity
//! `full` the water that the sphere pushes away turns the coin before anything touches it; with
//! `isolated` the coin is never moved by the sphere.
//!
//! ```text
//! cargo run --release --example falling_ball -- [--faces N] [--steps N] [--out FILE.svg] [--json]
//! ```

use hydrograd::{Controls, Fidelity, Scene, Settings, Simulator};
use plotters::coord::Shift;
use plotters::prelude::*;
use serde::Serialize;
use std::error::Error;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// What the command line asks for.
struct Options {
    faces: usize,
    steps: Option<usize>,
    out: PathBuf,
    json: bool,
}

/// Coin and sphere against time.
#[derive(Serialize)]
struct Curve {
    fidelity: &'static str,
    /// s
    time: Vec<f64>,
    /// Angle of the coin from lying flat, degrees.
    coin_angle: Vec<f64>,
    /// Height of the coin's centre above the floor, m.
    coin_height: Vec<f64>,
    /// Height of the sphere's lowest point above the floor, m.
    sphere_gap: Vec<f64>,
    seconds: f64,
}

/// Height of the floor, radius of the sphere, m.
const FLOOR: f64 = -0.98;
const RADIUS: f64 = 0.6;

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/falling_ball.toml");
    let scene = Scene::load(&file)?;
    let curves = [
        simulate(&scene, Fidelity::Full, "full", &options)?,
        simulate(&scene, Fidelity::Isolated, "isolated", &options)?,
    ];
    plot(&options.out, &curves)?;
    if options.json {
        println!("{}", serde_json::to_string(&curves)?);
        return Ok(());
    }
    for c in &curves {
        let end = c.time.len() - 1;
        println!(
            "{:8}  coin at {:.2} s: {:+.2}° and {:.4} m above the floor   ({:.1} s)",
            c.fidelity, c.time[end], c.coin_angle[end], c.coin_height[end], c.seconds
        );
    }
    println!("wrote {}", options.out.display());
    Ok(())
}

fn options() -> Result<Options, String> {
    let mut out = Options {
        faces: 320,
        steps: None,
        out: "falling_ball.svg".into(),
        json: false,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{name} needs a value"));
        let number = |text: String| text.parse().map_err(|_| format!("{text}: not a number"));
        match name.as_str() {
            "--faces" => out.faces = number(value()?)?,
            "--steps" => out.steps = Some(number(value()?)?),
            "--out" => out.out = value()?.into(),
            "--json" => out.json = true,
            _ => {
                return Err(format!(
                    "{name}: expected --faces, --steps, --out or --json"
                ));
            }
        }
    }
    Ok(out)
}

fn simulate(
    scene: &Scene,
    fidelity: Fidelity,
    name: &'static str,
    options: &Options,
) -> Result<Curve, hydrograd::Error> {
    let start = std::time::Instant::now();
    let settings = Settings::default().fidelity(fidelity).faces(options.faces);
    let simulator = Simulator::new(scene, settings)?;
    let steps = options.steps.unwrap_or(scene.steps);
    let mut terminal = std::io::stderr();
    let show = terminal.is_terminal();
    // The scene's own controller pushes the sphere; no open-loop control is added to it.
    let rollout = simulator.rollout_with(&Controls::zeros(&simulator, steps), |done| {
        if show {
            let _ = write!(terminal, "\r{name}: step {done} of {steps} ");
            let _ = terminal.flush();
        }
    })?;
    if show {
        eprintln!();
    }
    let samples = rollout.samples();
    let of = |f: &dyn Fn(&hydrograd::simulate::Sample) -> f64| samples.iter().map(f).collect();
    Ok(Curve {
        fidelity: name,
        time: of(&|s| s.time),
        coin_angle: of(&|s| (s.q[3] - samples[0].q[3]).to_degrees()),
        coin_height: of(&|s| s.q[2] - FLOOR),
        sphere_gap: of(&|s| s.q[0] - RADIUS - FLOOR),
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// Angle above, heights below.
fn plot(file: &Path, curves: &[Curve]) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (640, 480)).into_drawing_area();
    area.fill(&WHITE)?;
    let (top, bottom) = area.split_vertically(240);
    panel(&top, "angle of the coin, degrees", curves, |c| {
        &c.coin_angle
    })?;
    panel(&bottom, "height of the coin, m", curves, |c| &c.coin_height)?;
    area.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    title: &str,
    curves: &[Curve],
    values: impl Fn(&Curve) -> &Vec<f64>,
) -> Result<(), Box<dyn Error>> {
    let all: Vec<f64> = curves.iter().flat_map(|c| values(c).clone()).collect();
    let (low, high) = all
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
    let margin = 0.08 * (high - low).max(1e-6);
    let end = curves[0].time[curves[0].time.len() - 1];
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .caption(title, ("sans-serif", 15))
        .x_label_area_size(28)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..end, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (curve, color) in curves.iter().zip([BLUE, RED]) {
        let points = curve
            .time
            .iter()
            .copied()
            .zip(values(curve).iter().copied());
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(curve.fidelity)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE)
        .draw()?;
    Ok(())
}
