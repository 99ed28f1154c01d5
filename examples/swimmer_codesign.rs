//! A swimmer's body and gait, designed together.
//!
//! A fish of three ellipsoids, as heavy as the water it displaces, hangs together by two elastic joints with a motor each. In four seconds from rest it
//! shall get as far as it can. Found are the torques of both motors at each of 200 steps and, in the co-design, how high and how thick each link is. What is
//! the same for all: the effort (the root of the sum of all squared torques), the time, the length of the links, the joints' springs and dampers, and the volume
//! of the fish, so its mass too.
//!
//! Control alone has a hard-working rival here: it descends from four gaits (two phases between the joints, three frequencies), with more rollouts in total than the
//! co-design has, which starts from one. No link gets more than half as high or thick again (a factor of exp(0.4)), before all are thinned to the same volume.
//!
//! The water is `isolated`: each link has its own added mass, and they don't feel each other's flow. It is a potential flow: no wake, no stall. The drag of a
//! real fish would cost both.
//!
//! ```text
//! cargo run --release --example swimmer_codesign -- [--quick] [--check] [--out FILE.svg] [--json]
//! ```
//!
//! `--check` holds derivatives against differences.

mod codesign;

use codesign::{Design, Options, descend, scaled, scaled_vjp};
use hydrograd::optimize::OptimizeSettings;
use hydrograd::scene::{Passive, Plane};
use hydrograd::simulate::Rollout;
use hydrograd::{Body, Controls, Fidelity, Fluid, Joint, Scene, Settings, Shape, Simulator};
use nalgebra::DMatrix;
use plotters::prelude::*;
use serde::Serialize;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

const STEPS: usize = 200;
const TIME_STEP: f64 = 0.02;
const LINKS: [&str; 3] = ["tail", "middle", "head"];
/// Semi-axes of every link at the start, along x, y and z, m.
const LENGTH: f64 = 1.0 / 6.0;
const WIDTH: f64 = 1.0 / 30.0;
const HEIGHT: f64 = 1.0 / 6.0;
/// From a link's tip to the joint, m.
const JOINT: f64 = 0.02;
/// Of the joints, N·m/rad and N·m·s/rad.
const STIFFNESS: f64 = 5.0;
const DAMPING: f64 = 0.3;
/// Root of the sum of all squared torques, N·m.
const EFFORT: f64 = 20.0;
/// Of the logarithms of widths and heights.
const REACH: [f64; 6] = [0.4; 6];
/// Frequency, rad/s, and how far the tail's torque is ahead, rad.
const GAITS: [[f64; 2]; 4] = [[4.0, 1.5], [4.0, -1.5], [5.5, 1.5], [2.8, 1.5]];
/// Water and fish, kg/m³.
const DENSITY: f64 = 998.0;

/// A fish whose links have these widths and heights (semi-axes, m).
fn scene(sizes: &[[f64; 2]; 3]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: DENSITY,
        ..Fluid::fresh_water()
    });
    (scene.time_step, scene.steps) = (TIME_STEP, STEPS);
    let link = |k: usize| {
        let [width, height] = sizes[k];
        Body::new(Shape::ellipsoid([LENGTH, width, height]))
            .named(LINKS[k])
            .density(DENSITY)
    };
    scene.add(link(1).joint(Joint::Planar { plane: Plane::Xy }));
    for (k, side) in [(2, 1.0), (0, -1.0)] {
        let hinge = Joint::Revolute {
            axis: [0.0, 0.0, 1.0],
        };
        let spring = Passive::default().stiffness(STIFFNESS).damping(DAMPING);
        let body = link(k).child_of("middle").at([side * LENGTH, 0.0, 0.0]);
        let body = body.shape_at([side * (LENGTH + JOINT), 0.0, 0.0], [0.0; 3]);
        scene.add(body.joint(hinge).passive(spring).actuated());
    }
    scene
}

/// Torques that start a descent, head and tail by turns: their size doesn't count.
fn gait([frequency, ahead]: [f64; 2]) -> Design {
    let at = |n: usize| frequency * TIME_STEP * n as f64;
    Design {
        pattern: (0..STEPS)
            .flat_map(|n| [at(n).sin(), (at(n) + ahead).sin()])
            .collect(),
        logs: vec![0.0; 6],
    }
}

/// Widths and heights, and each link's part of the volume. The volume of all is kept by the widths.
fn sizes(logs: &[f64]) -> ([[f64; 2]; 3], [f64; 3]) {
    let volume: [f64; 3] = std::array::from_fn(|k| (logs[2 * k] + logs[2 * k + 1]).exp());
    let all: f64 = volume.iter().sum();
    let size = |k: usize| {
        [
            WIDTH * logs[2 * k].exp() * 3.0 / all,
            HEIGHT * logs[2 * k + 1].exp(),
        ]
    };
    (std::array::from_fn(size), volume.map(|v| v / all))
}

fn run(design: &Design) -> hydrograd::Result<Rollout> {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let names = LINKS.map(|link| format!("{link}.semi_axes")).to_vec();
    let scene = scene(&sizes(&design.logs).0);
    let simulator = Simulator::new(&scene, settings.shape_parameters(names))?;
    let torques = DMatrix::from_vec(2, STEPS, scaled(&design.pattern, EFFORT));
    simulator.rollout(&Controls::from_matrix(&simulator, torques)?)
}

/// Of the middle along x, m.
fn way(rollout: &Rollout, n: usize) -> f64 {
    let x = |n: usize| rollout.samples()[n].poses[0].translation.x;
    x(n) - x(0)
}

/// Minus the distance, m, and its derivatives.
fn cost(design: &Design) -> hydrograd::Result<(f64, Design)> {
    let rollout = run(design)?;
    let mut seed = rollout.zero_cotangents();
    seed.positions[(0, STEPS)] = -1.0;
    let gradient = rollout.vjp(&seed)?;
    let (sizes, shares) = sizes(&design.logs);
    let mut logs = Vec::new();
    for (link, size) in LINKS.iter().zip(sizes) {
        for (k, axis) in ["y", "z"].iter().enumerate() {
            let name = format!("{link}.semi_axes.{axis}");
            logs.push(size[k] * gradient.parameters.get(&name)?);
        }
    }
    // A link that grows makes all links thinner.
    let thinner: f64 = logs.iter().step_by(2).sum();
    for (k, bar) in logs.iter_mut().enumerate() {
        *bar -= shares[k / 2] * thinner;
    }
    let pattern = scaled_vjp(&design.pattern, EFFORT, gradient.controls.as_slice());
    Ok((-way(&rollout, STEPS), Design { pattern, logs }))
}

/// The largest part by which a derivative is off from a central difference: one of a torque, and those of all logarithms.
fn check() -> hydrograd::Result<f64> {
    let mut design = gait(GAITS[0]);
    design.logs = vec![0.1, -0.05, 0.02, 0.1, -0.1, 0.2];
    let (_, bar) = cost(&design)?;
    let most = |bar: &[f64]| bar.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
    let off = |by: f64, most: f64, h: f64, moved: &dyn Fn(&mut Design, f64)| {
        let end = |h: f64| {
            let mut other = design.clone();
            moved(&mut other, h);
            Ok(-way(&run(&other)?, STEPS))
        };
        Ok::<_, hydrograd::Error>((((end(h)? - end(-h)?) / (2.0 * h) - by) / most).abs())
    };
    let mut worst = off(bar.pattern[121], most(&bar.pattern), 1e-3, &|d, h| {
        d.pattern[121] += h;
    })?;
    for k in 0..6 {
        worst = worst.max(off(bar.logs[k], most(&bar.logs), 1e-4, &|d, h| {
            d.logs[k] += h
        })?);
    }
    Ok(worst)
}

#[derive(Serialize)]
struct Swim {
    /// m
    distance: f64,
    /// N·m
    effort: f64,
    /// What the motors put in, J: the sum of their positive powers.
    work: f64,
    /// Semi-axes of tail, middle and head, m.
    widths: [f64; 3],
    heights: [f64; 3],
    rollouts: usize,
    /// m, at every state.
    course: Vec<f64>,
}

fn swim(design: &Design, rollouts: usize) -> hydrograd::Result<Swim> {
    let rollout = run(design)?;
    let torques = scaled(&design.pattern, EFFORT);
    // The joints' coordinates are the last two.
    let angle = |n: usize, k: usize| rollout.samples()[n].q[3 + k];
    let powers = (0..STEPS).flat_map(|n| [0, 1].map(|k| (n, k)));
    let sizes = sizes(&design.logs).0;
    Ok(Swim {
        distance: way(&rollout, STEPS),
        effort: EFFORT,
        work: powers
            .map(|(n, k)| (torques[2 * n + k] * (angle(n + 1, k) - angle(n, k))).max(0.0))
            .sum(),
        widths: sizes.map(|s| s[0]),
        heights: sizes.map(|s| s[1]),
        rollouts,
        course: (0..=STEPS).map(|n| way(&rollout, n)).collect(),
    })
}

#[derive(Serialize)]
struct Report {
    alone: Swim,
    together: Swim,
    /// By how much farther, in parts.
    gain: f64,
    seconds: f64,
}

fn study(quick: bool) -> hydrograd::Result<Report> {
    let began = Instant::now();
    let (iterations, gaits) = if quick { (8, 1) } else { (100, GAITS.len()) };
    let settings = OptimizeSettings {
        iterations,
        evaluations: 2 * iterations,
        memory: 20,
        cost_tolerance: 1e-6,
        ..OptimizeSettings::default()
    };
    let mut best: Option<(f64, Design)> = None;
    let mut counts = [0; 2];
    for start in &GAITS[..gaits] {
        let counted = |d: &Design| {
            counts[0] += 1;
            cost(d)
        };
        let found = descend(counted, &gait(*start), None, &settings)?;
        let far = way(&run(&found)?, STEPS);
        eprintln!("control alone from {start:?}: {far:.4} m");
        if best.as_ref().is_none_or(|b| far > b.0) {
            best = Some((far, found));
        }
    }
    let counted = |d: &Design| {
        counts[1] += 1;
        cost(d)
    };
    let shaped = descend(counted, &gait(GAITS[0]), Some(&REACH), &settings)?;
    let alone = swim(&best.map_or_else(|| gait(GAITS[0]), |b| b.1), counts[0])?;
    let together = swim(&shaped, counts[1])?;
    Ok(Report {
        gain: together.distance / alone.distance - 1.0,
        alone,
        together,
        seconds: began.elapsed().as_secs_f64(),
    })
}

/// Both fish from the side and from above, and how they get on.
fn plot(file: &Path, report: &Report) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (760, 560)).into_drawing_area();
    area.fill(&WHITE)?;
    let (above, below) = area.split_vertically(300);
    let own = [
        (&report.alone, "control alone", RGBColor(110, 110, 110)),
        (&report.together, "body and gait", BLUE),
    ];
    for (half, (swim, name, colour)) in above.split_evenly((1, 2)).iter().zip(&own) {
        // Equal scales: 360 pixels are 1.15 m.
        let mut chart = ChartBuilder::on(half)
            .caption(format!("{name}: side, top"), ("sans-serif", 15))
            .build_cartesian_2d(-0.575..0.575, -0.5..0.375)?;
        for (sizes, middle) in [(&swim.heights, 0.1), (&swim.widths, -0.33)] {
            for (k, size) in sizes.iter().enumerate() {
                let place = (k as f64 - 1.0) * (2.0 * LENGTH + JOINT);
                let edge = (0..60).map(|i| {
                    let turn = i as f64 * std::f64::consts::TAU / 60.0;
                    (place + LENGTH * turn.cos(), middle + size * turn.sin())
                });
                let link = Polygon::new(edge.collect::<Vec<_>>(), colour.mix(0.6));
                chart.draw_series([link])?;
            }
        }
    }
    let most = report.together.distance.max(report.alone.distance);
    let mut chart = ChartBuilder::on(&below)
        .margin(10)
        .x_label_area_size(32)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..STEPS as f64 * TIME_STEP, -0.2 * most..1.1 * most)?;
    chart
        .configure_mesh()
        .x_desc("t, s")
        .y_desc("way, m")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (swim, name, colour) in own {
        let points = swim.course.iter().enumerate();
        let line = LineSeries::new(points.map(|(n, x)| (n as f64 * TIME_STEP, *x)), colour);
        chart
            .draw_series(line)?
            .label(format!("{name}: {:.3} m", swim.distance))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .draw()?;
    area.present()?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::read()?;
    if options.check {
        let off = check()?;
        println!("derivatives and differences: apart by {off:.1e} of the largest");
        return if off < 1e-5 {
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
        ("body and gait", &report.together),
    ];
    for (name, s) in own {
        println!(
            "{name}: {:.3} m, {:.2} J of work, {} rollouts",
            s.distance, s.work, s.rollouts
        );
    }
    println!(
        "farther by {:.0} % at the same effort; {:.0} s",
        100.0 * report.gain,
        report.seconds
    );
    for (k, link) in LINKS.iter().enumerate() {
        println!(
            "{link}: {:.0} mm thick, {:.0} mm high (was {:.0}, {:.0})",
            2e3 * report.together.widths[k],
            2e3 * report.together.heights[k],
            2e3 * WIDTH,
            2e3 * HEIGHT
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn derivatives_are_those_of_differences() {
        assert!(super::check().unwrap() < 1e-5);
    }

    #[test]
    fn a_body_for_its_gait_swims_farther() {
        let report = super::study(true).unwrap();
        assert!(report.alone.distance > 0.07 && report.gain > 0.2);
        // As heavy as before.
        let sizes = report.together.widths.iter().zip(&report.together.heights);
        let volume: f64 = sizes.map(|(w, h)| w * h).sum();
        assert!((volume / (3.0 * super::WIDTH * super::HEIGHT) - 1.0).abs() < 1e-12);
    }
}
