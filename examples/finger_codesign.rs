//! A gripper's fingers and how they close, designed together.
//!
//! Two equal fingers on rails close around a free coin in water, from 0.16 m to 0.04 m beside its middle, within a second. The coin isn't in the middle
//! of the fingers: the water that they squeeze out takes it along before they have it. Wanted is that the fingers arrive soon and that the coin stays where it is. Found
//! are the forces on the fingers (eight knots, lines between them) and, in the co-design, the fingers' width and length. What is the same for all: the effort (the
//! root of the sum of the squared forces), the time, the volume of a finger, so its mass (thickness makes up for width and length), and the opening at the
//! start. A finger stays as wide as the coin, 0.06 m, which is what holds it, and is at least 0.16 m long.
//!
//! The cost is the mean of the squared lateness (the opening that is left, in parts of the first one; the last tenth of the time counts ten times), and the
//! square of how far the coin has gone, 1 for 0.045 m. Control alone descends first; the co-design goes on from where that ended, and so does control alone.
//!
//! The water is `reduced`, without films, for shape gradients aren't there where films carry a gap: so the fingers stop 0.03 m beside the coin's faces, where the gap
//! is resolved. Gradients with respect to the shape pass through the compression and are right to its accuracy (`--check` tells). Both results are run again with finer surfaces
//! and a ten times finer compression.
//!
//! ```text
//! cargo run --release --example finger_codesign -- [--quick] [--check] [--out FILE.svg] [--json]
//! ```

mod codesign;

use codesign::{Design, Options, descend, scaled, scaled_vjp};
use hydrograd::optimize::OptimizeSettings;
use hydrograd::scene::Plane;
use hydrograd::simulate::Rollout;
use hydrograd::{Body, Controls, Fidelity, Fluid, Joint, Scene, Settings, Shape, Simulator};
use nalgebra::DMatrix;
use plotters::prelude::*;
use serde::Serialize;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

const STEPS: usize = 50;
const TIME_STEP: f64 = 0.02;
/// Width, thickness and length of a finger at the start, m.
const SIZE: [f64; 3] = [0.10, 0.03, 0.20];
/// Smallest width and length, m.
const LEAST: [f64; 2] = [0.06, 0.16];
/// Of a finger's face from the middle, m.
const OPEN: f64 = 0.16;
const SHUT: f64 = 0.04;
/// Semi-axes, m, and how far the coin is from the fingers' middle.
const COIN: [f64; 3] = [0.03, 0.008, 0.03];
const COIN_Z: f64 = 0.06;
/// Root of the sum of one finger's squared forces, N.
const EFFORT: f64 = 8.0;
const KNOTS: usize = 8;
/// 1/m²
const COIN_WEIGHT: f64 = 500.0;
/// How many states at the end count how much.
const LATEST: usize = STEPS / 10;
const LATEST_WEIGHT: f64 = 10.0;
/// Part of the opening that is left once fingers have arrived.
const ARRIVED: f64 = 0.1;
/// Faces of every body and accuracy of the compression, for the descent and to run results again.
const COARSE: (usize, f64) = (160, 1e-2);
const FINE: (usize, f64) = (640, 1e-3);

fn scene(size: [f64; 3]) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    (scene.time_step, scene.steps) = (TIME_STEP, STEPS);
    for (name, side) in [("left", -1.0), ("right", 1.0)] {
        let rail = Joint::Prismatic {
            axis: [0.0, 1.0, 0.0],
        };
        let finger = Body::new(Shape::cuboid(size)).named(name).density(1200.0);
        let place = [0.0, side * (OPEN + size[1] / 2.0), 0.0];
        scene.add(finger.at(place).joint(rail).actuated());
    }
    let coin = Body::new(Shape::ellipsoid(COIN))
        .named("coin")
        .density(1300.0);
    let plane = Joint::Planar { plane: Plane::Yz };
    scene.add(coin.at([0.0, 0.0, COIN_Z]).joint(plane));
    scene
}

/// Width, thickness and length from the logarithms of width and length: the thickness keeps the volume.
fn size(logs: &[f64]) -> [f64; 3] {
    let logs = [logs[0], -logs[0] - logs[1], logs[1]];
    std::array::from_fn(|k| SIZE[k] * logs[k].exp())
}

/// Forces at the steps from those at the knots: lines between them.
fn lines(knots: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; STEPS];
    each_part(|n, k, part| out[n] += part * knots[k]);
    out
}

/// Calls with step, knot and weight.
fn each_part(mut call: impl FnMut(usize, usize, f64)) {
    for n in 0..STEPS {
        let place = n as f64 * (KNOTS - 1) as f64 / (STEPS - 1) as f64;
        let k = (place as usize).min(KNOTS - 2);
        let part = place - k as f64;
        call(n, k, 1.0 - part);
        call(n, k + 1, part);
    }
}

/// Of the states' squared lateness.
fn weight(n: usize) -> f64 {
    let own = if n > STEPS - LATEST {
        LATEST_WEIGHT
    } else {
        1.0
    };
    own / (STEPS + 1) as f64
}

/// Shapes are parameters if `shaped`: that costs two more fits for each.
fn simulator(
    logs: &[f64],
    (faces, accuracy): (usize, f64),
    shaped: bool,
) -> hydrograd::Result<Simulator> {
    let settings = Settings::default().fidelity(Fidelity::Reduced).films(false);
    let settings = settings.faces(faces).accuracy(accuracy);
    let names = if shaped {
        vec!["left".into(), "right".into()]
    } else {
        Vec::new()
    };
    Simulator::new(&scene(size(logs)), settings.shape_parameters(names))
}

fn run(simulator: &Simulator, knots: &[f64]) -> hydrograd::Result<Rollout> {
    let forces = scaled(&lines(knots), EFFORT);
    let matrix = DMatrix::from_fn(2, STEPS, |k, n| if k == 0 { forces[n] } else { -forces[n] });
    simulator.rollout(&Controls::from_matrix(simulator, matrix)?)
}

/// The part of the opening that is left, and how far the coin has gone along the fingers, m: at every state.
fn seen(rollout: &Rollout, thickness: f64) -> (Vec<f64>, Vec<f64>) {
    let first = rollout.samples()[0].poses[2].translation.z;
    let of = rollout.samples().iter().map(|s| {
        let apart = s.poses[1].translation.y - s.poses[0].translation.y - thickness;
        let late = (apart / 2.0 - SHUT) / (OPEN - SHUT);
        (late, s.poses[2].translation.z - first)
    });
    of.unzip()
}

/// Cost and its derivatives.
fn cost(simulator: &Simulator, design: &Design, shaped: bool) -> hydrograd::Result<(f64, Design)> {
    let rollout = run(simulator, &design.pattern)?;
    let size = size(&design.logs);
    let (late, moved) = seen(&rollout, size[1]);
    let mut seed = rollout.zero_cotangents();
    let (mut value, mut opening) = (COIN_WEIGHT * moved[STEPS].powi(2), 0.0);
    for (n, late) in late.iter().enumerate() {
        value += weight(n) * late * late;
        let bar = weight(n) * late / (OPEN - SHUT);
        seed.positions[(4, n)] = bar;
        seed.positions[(1, n)] = -bar;
        opening += bar;
    }
    seed.positions[(8, STEPS)] = 2.0 * COIN_WEIGHT * moved[STEPS];
    let gradient = rollout.vjp(&seed)?;
    let bar: Vec<f64> = gradient
        .controls
        .column_iter()
        .map(|c| c[0] - c[1])
        .collect();
    let bar = scaled_vjp(&lines(&design.pattern), EFFORT, &bar);
    let mut pattern = vec![0.0; KNOTS];
    each_part(|n, k, part| pattern[k] += part * bar[n]);
    if !shaped {
        let logs = vec![0.0; 2];
        return Ok((value, Design { pattern, logs }));
    }
    let mut along = [0.0; 3];
    for (k, axis) in ["x", "y", "z"].iter().enumerate() {
        for finger in ["left", "right"] {
            along[k] += gradient.parameters.get(&format!("{finger}.size.{axis}"))?;
        }
    }
    // Faces are half a thickness before the middles, and the middles start half a thickness behind the faces.
    along[1] += (gradient.initial.q[1] - gradient.initial.q[0]) / 2.0 - opening;
    for (along, size) in along.iter_mut().zip(size) {
        *along *= size;
    }
    let logs = vec![along[0] - along[1], along[2] - along[1]];
    Ok((value, Design { pattern, logs }))
}

/// Closes for three quarters of the time: pushed, then held back.
fn first() -> Design {
    let at = |k: usize| k as f64 / (KNOTS - 1) as f64;
    let push = |t: f64| (std::f64::consts::PI * t / 0.75).cos();
    Design {
        pattern: (0..KNOTS)
            .map(|k| if at(k) < 0.75 { push(at(k)) } else { 0.0 })
            .collect(),
        logs: vec![0.0; 2],
    }
}

/// By how much derivatives are off from central differences, in parts of the largest: of a knot, and of the logarithms, where each end is
/// compressed anew.
fn check() -> hydrograd::Result<[f64; 2]> {
    let mut at = first();
    at.logs = vec![-0.1, 0.05];
    let here = simulator(&at.logs, COARSE, true)?;
    let (_, bar) = cost(&here, &at, true)?;
    let most = |bar: &[f64]| bar.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
    let end = |h: f64| {
        let mut other = at.clone();
        other.pattern[2] += h;
        Ok::<_, hydrograd::Error>(cost(&here, &other, false)?.0)
    };
    let forces = ((end(1e-4)? - end(-1e-4)?) / 2e-4 - bar.pattern[2]).abs() / most(&bar.pattern);
    let mut shape: f64 = 0.0;
    for k in 0..2 {
        let end = |h: f64| {
            let mut other = at.clone();
            other.logs[k] += h;
            let there = simulator(&other.logs, COARSE, false)?;
            Ok::<_, hydrograd::Error>(cost(&there, &other, false)?.0)
        };
        let slope = (end(2e-2)? - end(-2e-2)?) / 4e-2;
        shape = shape.max((slope - bar.logs[k]).abs() / most(&bar.logs));
    }
    Ok([forces, shape])
}

#[derive(Serialize)]
struct Numbers {
    /// Mean of its square.
    lateness: f64,
    /// s, if ever.
    arrived: Option<f64>,
    /// m: at the end, and at most.
    coin_moved: f64,
    coin_moved_most: f64,
}

fn numbers(late: &[f64], moved: &[f64]) -> Numbers {
    let outside = late.iter().rposition(|l| l.abs() > ARRIVED);
    let arrived = outside.map_or(0, |n| n + 1);
    Numbers {
        lateness: late.iter().map(|l| l * l).sum::<f64>() / late.len() as f64,
        arrived: (arrived <= STEPS).then_some(arrived as f64 * TIME_STEP),
        coin_moved: moved[STEPS],
        coin_moved_most: moved.iter().fold(0.0, |m, x| m.max(x.abs())),
    }
}

#[derive(Serialize)]
struct Grip {
    numbers: Numbers,
    finer: Option<Numbers>,
    /// N
    effort: f64,
    /// Width, thickness, length, m.
    size: [f64; 3],
    rollouts: usize,
    left: Vec<f64>,
    coin: Vec<f64>,
}

fn grip(design: &Design, rollouts: usize, finer: bool) -> hydrograd::Result<Grip> {
    let size = size(&design.logs);
    let at = |fine| {
        let simulator = simulator(&design.logs, fine, false)?;
        Ok::<_, hydrograd::Error>(seen(&run(&simulator, &design.pattern)?, size[1]))
    };
    let (left, coin) = at(COARSE)?;
    let finer = match finer {
        true => Some(at(FINE).map(|(late, moved)| numbers(&late, &moved))?),
        false => None,
    };
    Ok(Grip {
        numbers: numbers(&left, &coin),
        finer,
        effort: EFFORT,
        size,
        rollouts,
        left,
        coin,
    })
}

#[derive(Serialize)]
struct Report {
    alone: Grip,
    together: Grip,
    /// By how much less, in parts.
    less_lateness: f64,
    less_motion: f64,
    seconds: f64,
}

fn study(quick: bool) -> hydrograd::Result<Report> {
    let began = Instant::now();
    let settings = |iterations, cost_tolerance| OptimizeSettings {
        iterations,
        evaluations: 2 * iterations,
        cost_tolerance,
        first_step: Some(0.3),
        ..OptimizeSettings::default()
    };
    let (short, long) = if quick { (6, 6) } else { (25, 40) };
    let unshaped = simulator(&[0.0; 2], COARSE, false)?;
    let mut counts = [0; 2];
    let mut alone = |start: &Design, iterations, tolerance| {
        let counted = |d: &Design| {
            counts[0] += 1;
            cost(&unshaped, d, false)
        };
        descend(counted, start, None, &settings(iterations, tolerance))
    };
    let middle = alone(&first(), long, 1e-4)?;
    // What the co-design goes on for, the rival goes on for as well, and doesn't end where little is left to gain.
    let before = alone(&middle, long, 1e-7)?;
    let reach = [SIZE[0] / LEAST[0], SIZE[2] / LEAST[1]].map(f64::ln);
    let counted = |d: &Design| {
        counts[1] += 1;
        cost(&simulator(&d.logs, COARSE, true)?, d, true)
    };
    let after = descend(counted, &middle, Some(&reach), &settings(short, 1e-4))?;
    let alone = grip(&before, counts[0], !quick)?;
    let together = grip(&after, counts[1], !quick)?;
    let (a, b) = (&alone.numbers, &together.numbers);
    Ok(Report {
        less_lateness: 1.0 - b.lateness / a.lateness,
        less_motion: 1.0 - (b.coin_moved / a.coin_moved).abs(),
        alone,
        together,
        seconds: began.elapsed().as_secs_f64(),
    })
}

/// Both grippers from the side, and what happens.
fn plot(file: &Path, report: &Report) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (760, 520)).into_drawing_area();
    area.fill(&WHITE)?;
    let (above, below) = area.split_vertically(240);
    let own = [
        (&report.alone, "control alone", RGBColor(110, 110, 110)),
        (&report.together, "fingers and control", BLUE),
    ];
    for (half, (grip, name, colour)) in above.split_evenly((1, 2)).iter().zip(&own) {
        let mut chart = ChartBuilder::on(half)
            .caption(*name, ("sans-serif", 15))
            .build_cartesian_2d(-0.26..0.26, -0.13..0.15)?;
        for (face, dark) in [(OPEN, 0.25), (SHUT, 0.8)] {
            for side in [-1.0, 1.0] {
                let ends = [face, face + grip.size[1]].map(|y| side * y);
                let corners = [
                    (ends[0], -grip.size[2] / 2.0),
                    (ends[1], grip.size[2] / 2.0),
                ];
                chart.draw_series([Rectangle::new(corners, colour.mix(dark).filled())])?;
            }
        }
        for (up, dark) in [(0.0, 0.4), (grip.coin[STEPS], 1.0)] {
            let edge = (0..60).map(|i| {
                let turn = i as f64 * std::f64::consts::TAU / 60.0;
                (COIN[1] * turn.cos(), COIN_Z + up + COIN[2] * turn.sin())
            });
            chart.draw_series([Polygon::new(edge.collect::<Vec<_>>(), RED.mix(dark))])?;
        }
    }
    let halves = below.split_evenly((1, 2));
    let courses = [
        ("opening left, %", 100.0, own.map(|o| &o.0.left)),
        ("coin moved, mm", 1e3, own.map(|o| &o.0.coin)),
    ];
    for (half, (what, unit, both)) in halves.iter().zip(courses) {
        let all = both.iter().flat_map(|course| course.iter());
        let (low, high) = all.fold((0.0, 0.0), |(l, h): (f64, f64), x| (l.min(*x), h.max(*x)));
        let mut chart = ChartBuilder::on(half)
            .margin(10)
            .x_label_area_size(32)
            .y_label_area_size(50)
            .build_cartesian_2d(
                0.0..STEPS as f64 * TIME_STEP,
                1.1 * unit * low..1.1 * unit * high,
            )?;
        chart
            .configure_mesh()
            .x_desc("t, s")
            .y_desc(what)
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (course, (_, _, colour)) in both.iter().zip(own) {
            let points = course.iter().enumerate();
            let line = points.map(|(n, x)| (n as f64 * TIME_STEP, unit * x));
            chart.draw_series(LineSeries::new(line, colour))?;
        }
    }
    area.present()?;
    Ok(())
}

fn tell(name: &str, n: &Numbers) {
    let arrived = match n.arrived {
        Some(t) => format!("after {t:.2} s"),
        None => "never".into(),
    };
    println!(
        "{name}: nine tenths closed {arrived}, squared lateness {:.3}, coin moved {:.1} mm",
        n.lateness,
        1e3 * n.coin_moved
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::read()?;
    if options.check {
        let [forces, shape] = check()?;
        println!(
            "off by {forces:.1e} (forces) and {shape:.1e} (shape, compressed anew) of the largest"
        );
        return if forces < 1e-5 && shape < 0.1 {
            Ok(())
        } else {
            Err("a derivative is wrong".into())
        };
    }
    let report = study(options.quick)?;
    if let Some(file) = &options.out {
        plot(file, &report)?;
    }
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let own = [
        ("control alone", &report.alone),
        ("fingers and control", &report.together),
    ];
    for (name, grip) in own {
        tell(name, &grip.numbers);
        if let Some(finer) = &grip.finer {
            tell(&format!("{name}, finer"), finer);
        }
    }
    println!(
        "less: lateness by {:.0} %, motion of the coin by {:.0} %, at the same effort; {:.0} s",
        100.0 * report.less_lateness,
        100.0 * report.less_motion,
        report.seconds
    );
    let mm = |size: [f64; 3]| size.map(|s| format!("{:.0}", 1e3 * s)).join(" × ");
    println!(
        "finger: {} mm (was {}; width, thickness, length)",
        mm(report.together.size),
        mm(SIZE)
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_finger_for_its_motion_is_sooner_and_disturbs_less() {
        let [forces, shape] = super::check().unwrap();
        assert!(forces < 1e-5 && shape < 0.1);
        let report = super::study(true).unwrap();
        assert!(report.less_lateness > 0.1 && report.less_motion > 0.1);
        let volume: f64 = report.together.size.iter().product();
        assert!((volume / super::SIZE.iter().product::<f64>() - 1.0).abs() < 1e-12);
    }
}
