//! Mass and drag of a coin, recovered from a noisy recording of how it sinks.
//!
//! A coin sinks and swings above the floor of a tank, and a camera sees where its centre is, to within 2 mm (Gaussian, the same at
//! every step). From this recording alone the coin's mass and its drag coefficient are to be found; its shape, the water and the place and time
//! at which it was let go are known. The recording is made by the simulator itself with known values, so that what is found can be
//! held against the truth.
//!
//! `optimize::identify` finds both, over their logarithms (neither can become negative, and a step is a part of the value), by Levenberg and Marquardt on exact Jacobians
//! of the rollout, and gives standard errors. One recording either is within two standard errors or isn't, so the fit is repeated for many recordings, of other noise:
//! some 95 % of the values should be within two, and the square of their deviations over the standard errors should be 1 on the mean.
//!
//! The inertia is known like the shape. Measured, on two cores: mass 29.86 ± 0.14 g (true 30.00) and drag 0.391 ± 0.009 (true 0.400), both
//! 1.0 standard errors off (they are correlated, 0.98: a heavier coin with more drag sinks alike); of 20 recordings all values within two standard
//! errors, mean square 1.04, in 22 s; of 60 recordings 98 %, 1.11.
//!
//! ```text
//! cargo run --release --example system_id -- [--noise METRES] [--seed N] [--recordings N] [--out FILE.svg] [--json]
//! ```

use hydrograd::optimize::{
    Experiment, Fitted, IdentifySettings, IdentifyStop, Recorded, Unknown, identify,
};
use hydrograd::scene::{Drag, DragPart, Plane, Wall};
use hydrograd::{Body, Controls, Fidelity, Fluid, Joint, Scene, Settings, Shape, Simulator};
use nalgebra::DVector;
use plotters::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use serde::Serialize;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The truth: kg; per area, dimensionless.
const MASS: f64 = 0.030;
const DRAG: f64 = 0.4;
/// What is guessed at the start, in parts of the truth.
const GUESS: [f64; 2] = [1.5, 0.4];
/// A camera of 100 frames a second for one second.
const TIME_STEP: f64 = 0.01;
const STEPS: usize = 100;
/// The parameters.
const NAMES: [&str; 2] = ["coin.mass", "coin.drag.quadratic"];

/// The only body.
const COIN: usize = 0;

/// A coin of 60 mm, let go aslant 0.6 m above the floor.
fn scene() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = TIME_STEP;
    scene.steps = STEPS;
    scene.gravity = [0.0, 0.0, -9.81];
    scene.walls = vec![Wall::rigid([0.0, 0.0, -0.6], [0.0, 0.0, 1.0])];
    let mut coin = Body::new(Shape::ellipsoid([0.03, 0.005, 0.03]).faces(320))
        .named("coin")
        .mass(MASS)
        .joint(Joint::Planar { plane: Plane::Yz });
    coin.drag = Some(Drag {
        quadratic: DRAG,
        quadratic_part: DragPart::Total,
        ..Drag::default()
    });
    scene.add(coin);
    // Nearly flat: the thin axis is the body's y.
    scene.initial.q = vec![0.0, 0.0, std::f64::consts::FRAC_PI_2 - 0.3];
    scene
}

/// Positions y, z of the coin at states 1 … N, m, one after the other.
fn positions(simulator: &Simulator) -> hydrograd::Result<DVector<f64>> {
    let rollout = simulator.rollout(&Controls::zeros(simulator, STEPS))?;
    let seen = rollout.samples()[1..].iter();
    let numbers = seen.flat_map(|s| [s.poses[COIN].translation.y, s.poses[COIN].translation.z]);
    Ok(DVector::from_iterator(2 * STEPS, numbers))
}

/// What was found from one recording.
#[derive(Clone, Serialize)]
struct Fit {
    /// kg
    mass: f64,
    mass_standard_error: f64,
    drag: f64,
    drag_standard_error: f64,
    /// Correlation of the errors of the two logarithms.
    correlation: f64,
    /// Deviations of the logarithms from the truth, in standard errors.
    deviations: [f64; 2],
    /// Twice the misfit over the degrees of freedom: 1 for noise as large as it is said to be.
    chi_squared: f64,
    simulations: usize,
    jacobians: usize,
    stop: IdentifyStop,
}

fn fit(
    scene: &Scene,
    exact: &DVector<f64>,
    noise: f64,
    seed: u64,
    loud: bool,
) -> Result<Fit, Box<dyn Error + Send + Sync>> {
    let simulator = simulator(scene)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, noise)?;
    let recording = exact.map(|x| x + normal.sample(&mut random));
    let controls = Controls::zeros(&simulator, STEPS);
    let mut run = Experiment::new("fall", simulator, controls);
    for k in 0..2 {
        run = run.saw(Recorded {
            observable: "positions".into(),
            entry: 3 * COIN + 1 + k,
            states: (1..=STEPS).collect(),
            values: (0..STEPS).map(|n| recording[2 * n + k]).collect(),
            deviation: noise,
        });
    }
    let truth = [MASS, DRAG];
    let unknown = |k: usize| Unknown::new(NAMES[k]).positive().start(GUESS[k] * truth[k]);
    let settings = IdentifySettings {
        profiles: 0,
        ..IdentifySettings::default()
    };
    let found = identify(&[run], &[unknown(0), unknown(1)], &settings, |p| {
        if loud {
            eprintln!("iteration {:2}: misfit {:12.4}", p.iteration, p.cost);
        }
        ControlFlow::Continue(())
    })?;
    let [mass, drag] = [0, 1].map(|k| &found.unknowns[k]);
    // Of the logarithm, in standard errors.
    let off = |u: &Fitted, truth: f64| (u.value / truth).ln() * u.value / u.standard_error;
    Ok(Fit {
        mass: mass.value,
        mass_standard_error: mass.standard_error,
        drag: drag.value,
        drag_standard_error: drag.standard_error,
        correlation: found.correlations[0][1],
        deviations: [off(mass, MASS), off(drag, DRAG)],
        chi_squared: found.chi_squared,
        simulations: found.simulations,
        jacobians: found.jacobians,
        stop: found.stop,
    })
}

fn simulator(scene: &Scene) -> hydrograd::Result<Simulator> {
    Simulator::new(scene, Settings::default().fidelity(Fidelity::Reduced))
}

#[derive(Serialize)]
struct Report {
    true_mass: f64,
    true_drag: f64,
    /// m
    noise: f64,
    seed: u64,
    fit: Fit,
    /// Whether both are within two standard errors.
    within_two: bool,
    recordings: usize,
    /// Part of all values of all recordings within two standard errors.
    part_within_two: f64,
    /// Mean square of the deviations in standard errors.
    mean_square: f64,
    seconds: f64,
}

struct Options {
    noise: f64,
    seed: u64,
    recordings: usize,
    out: Option<PathBuf>,
    json: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let began = Instant::now();
    let scene = scene();
    let exact = positions(&simulator(&scene)?)?;
    let noise = options.noise;
    let shown = fit(&scene, &exact, noise, options.seed, true).map_err(|e| e.to_string())?;
    let fits: Vec<Fit> = (0..options.recordings)
        .into_par_iter()
        .map(|k| {
            fit(&scene, &exact, noise, options.seed + k as u64, false).map_err(|e| e.to_string())
        })
        .collect::<Result<_, _>>()?;
    let all: Vec<f64> = fits.iter().flat_map(|f| f.deviations).collect();
    let within = all.iter().filter(|d| d.abs() <= 2.0).count();
    let report = Report {
        true_mass: MASS,
        true_drag: DRAG,
        noise,
        seed: options.seed,
        within_two: shown.deviations.iter().all(|d| d.abs() <= 2.0),
        fit: shown,
        recordings: fits.len(),
        part_within_two: within as f64 / all.len() as f64,
        mean_square: all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64,
        seconds: began.elapsed().as_secs_f64(),
    };
    if let Some(file) = &options.out {
        plot(file, &fits)?;
    }
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let f = &report.fit;
    println!(
        "positions seen to {:.1} mm, {STEPS} frames; correlation of the two {:+.2}",
        1e3 * noise,
        f.correlation
    );
    println!(
        "mass {:.3} ± {:.3} g, true {:.3} g: {:+.2} standard errors",
        1e3 * f.mass,
        1e3 * f.mass_standard_error,
        1e3 * MASS,
        f.deviations[0]
    );
    println!(
        "drag {:.4} ± {:.4}, true {:.4}: {:+.2} standard errors",
        f.drag, f.drag_standard_error, DRAG, f.deviations[1]
    );
    println!(
        "misfit per degree of freedom {:.2}; {} rollouts, {} Jacobians, ended by {:?}",
        f.chi_squared, f.simulations, f.jacobians, f.stop
    );
    println!(
        "{} recordings: {:.0} % of the values within two standard errors, mean square {:.2}; {:.0} s",
        report.recordings,
        100.0 * report.part_within_two,
        report.mean_square,
        report.seconds
    );
    Ok(())
}

fn options() -> Result<Options, String> {
    let mut out = Options {
        noise: 2e-3,
        seed: 1,
        recordings: 20,
        out: None,
        json: false,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{name} needs a value"));
        let count = |text: String| match text.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(format!("{text}: not a number of at least 1")),
        };
        match name.as_str() {
            "--noise" => {
                let text = value()?;
                out.noise = match text.parse() {
                    Ok(x) if x > 0.0 && f64::is_finite(x) => x,
                    _ => return Err(format!("{text}: not a positive number, m")),
                };
            }
            "--seed" => out.seed = count(value()?)? as u64,
            "--recordings" => out.recordings = count(value()?)?,
            "--out" => out.out = Some(value()?.into()),
            "--json" => out.json = true,
            _ => {
                return Err(format!(
                    "{name}: expected --noise, --seed, --recordings, --out or --json"
                ));
            }
        }
    }
    Ok(out)
}

/// Mass and drag of all recordings with their standard errors, and the truth.
fn plot(file: &Path, fits: &[Fit]) -> Result<(), Box<dyn Error>> {
    let widest = |of: &dyn Fn(&Fit) -> (f64, f64), truth: f64| {
        let reach = fits.iter().map(|f| (of(f).0 - truth).abs() + of(f).1);
        1.1 * reach.fold(0.0, f64::max)
    };
    let mass = |f: &Fit| (1e3 * f.mass, 1e3 * f.mass_standard_error);
    let drag = |f: &Fit| (f.drag, f.drag_standard_error);
    let (wide, high) = (widest(&mass, 1e3 * MASS), widest(&drag, DRAG));
    let area = SVGBackend::new(file, (480, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .caption(
            "fits with standard errors; the truth in red",
            ("sans-serif", 15),
        )
        .x_label_area_size(32)
        .y_label_area_size(56)
        .build_cartesian_2d(
            1e3 * MASS - wide..1e3 * MASS + wide,
            DRAG - high..DRAG + high,
        )?;
    chart
        .configure_mesh()
        .x_desc("mass, g")
        .y_desc("drag coefficient")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for f in fits {
        let ((m, dm), (d, dd)) = (mass(f), drag(f));
        chart.draw_series([
            PathElement::new([(m - dm, d), (m + dm, d)], BLUE.mix(0.4)),
            PathElement::new([(m, d - dd), (m, d + dd)], BLUE.mix(0.4)),
        ])?;
    }
    chart.draw_series([Circle::new((1e3 * MASS, DRAG), 4, RED.filled())])?;
    area.present()?;
    Ok(())
}
