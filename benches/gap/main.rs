//! Bodies that come near one another: added mass along the gap, and its slope, by every fidelity against references ([`references`]).
//!
//! `cargo bench --bench gap [-- CASE …] [--quick] [--plot]`: the cases whose names contain one of the words, or all. `--quick` with fewer gaps;
//! `--references` finds the references again; `--plot` writes the errors to docs/gap.svg as well; `--faces=320` with other faces a body than 1280. `--estimates` holds what runs estimate their errors to be against
//! them, on these cases and on others; `--accuracy` varies that for a sphere over a wall, or the cases named; `--time` has what films cost: evaluations and steps with them beside the same
//! without, and far apart. Gaps are in units of a radius or half a side; masses over the water's
//! density, m³, slopes m².

#[allow(dead_code)]
#[path = "../common/mod.rs"]
mod common;
mod facets;
mod kept;
mod references;
mod rings;

use common::{Effort, arguments, settings, step_times};
use hydrograd::adjoint::lie::{Vec3, exp_matrix};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Controls, Fidelity, Result, Settings, Simulator};
use nalgebra::DVector;
use plotters::prelude::*;
use references::Reference;
use std::path::Path;
use std::time::Instant;

/// The first body over the second, or over a wall.
struct Case {
    name: &'static str,
    shapes: Vec<Shape>,
    /// Rotation vectors of the bodies.
    turns: [[f64; 3]; 2],
    /// Height of the first body's origin where the gap is closed, m.
    closed: f64,
    /// Gaps are in units of it, m.
    size: f64,
}

const GAPS: [f64; 8] = [1.0, 0.5, 0.2, 0.1, 0.05, 0.025, 0.01, 0.001];
/// Of the cases that the estimates of errors weren't fitted to.
const HELD_OUT: [f64; 5] = [0.3, 0.1, 0.03, 0.01, 0.003];
const QUICK: [f64; 4] = [0.5, 0.1, 0.025, 0.001];
/// Faces of a body.
fn faces() -> usize {
    let given = arguments()
        .into_iter()
        .find_map(|a| a.strip_prefix("--faces=")?.parse().ok());
    given.unwrap_or(1280)
}

fn cases() -> Vec<Case> {
    let flat = [[0.0; 3]; 2];
    let case = |name, shapes: &[&Shape], turns, closed, size| Case {
        name,
        shapes: shapes.iter().map(|s| (*s).clone()).collect(),
        turns,
        closed,
        size,
    };
    let (ball, disc) = (Shape::sphere(1.0), Shape::cylinder(1.0, 0.25));
    let (brick, capsule) = (Shape::cuboid([1.0, 1.0, 0.5]), Shape::capsule(0.25, 1.0));
    let thin = Shape::ellipsoid([1.0, 1.0, 0.25]);
    let quarter = std::f64::consts::FRAC_PI_4;
    let across = [[0.0, 2.0 * quarter, 0.0], [2.0 * quarter, 0.0, 0.0]];
    let on_edge = [[quarter, 0.0, 0.0], [0.0; 3]];
    vec![
        case("sphere-sphere", &[&ball, &ball], flat, 2.0, 1.0),
        case("sphere-wall", &[&ball], flat, 1.0, 1.0),
        case("ellipsoid-wall", &[&thin], flat, 0.25, 1.0),
        case("disc-wall", &[&disc], flat, 0.125, 1.0),
        case("box-wall", &[&brick], flat, 0.25, 0.5),
        case("box-box", &[&brick, &brick], flat, 0.5, 0.5),
        case("edge-wall", &[&brick], on_edge, 0.75 / f64::sqrt(2.0), 0.5),
        case("capsule-capsule", &[&capsule, &capsule], across, 0.5, 0.25),
    ]
}

impl Case {
    /// The first body on a rail along the gap, the second one fixed.
    fn scene(&self, gap: f64) -> Scene {
        let mut scene = Scene::new(Fluid {
            density: 1.0,
            current: [0.0; 3],
        });
        if self.shapes.len() == 1 {
            scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        }
        for (b, shape) in self.shapes.iter().enumerate() {
            let up = exp_matrix(&Vec3::from(self.turns[b])).transpose() * Vec3::z();
            let (height, joint) = match b {
                0 => (self.closed + gap, Joint::Prismatic { axis: up.into() }),
                _ => (0.0, Joint::Fixed),
            };
            let body = Body::new(shape.clone()).density(1.0).joint(joint);
            scene.add(body.at([0.0, 0.0, height]).rotated(self.turns[b]));
        }
        scene
    }

    /// Added mass of the first body along the gap, and its slope.
    fn along(&self, gap: f64, settings: &Settings) -> Result<[f64; 2]> {
        let simulator = Simulator::new(&self.scene(gap), settings.clone())?;
        let (stepper, speed) = (simulator.stepper(), DVector::from_element(1, 1.0));
        let found = stepper.linearise(simulator.start().0, 0.0)?;
        // M v̇ = −½ (dM/dq) v² along the one coordinate.
        let force = found.inertial_force(&speed, &DVector::zeros(0))?;
        let dry = simulator.parameters().mass(0);
        Ok([found.mass_matrix()[(0, 0)] - dry, -2.0 * force[0]])
    }

    /// What a run with these settings says of the gap: the estimated errors of both.
    fn estimate(&self, gap: f64, settings: &Settings) -> Result<Option<[f64; 2]>> {
        let simulator = Simulator::new(&self.scene(gap), settings.clone())?;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 0))?;
        let nearest = rollout.gap_report().nearest;
        Ok(nearest.map(|near| [near.added_mass_error, near.force_error]))
    }

    /// M and its slope at a gap in the case's unit, and how far off they may be: the kept reference, or else of panels, the limit of ever more faces.
    fn converged(&self, gap: f64) -> Result<([f64; 2], [f64; 2])> {
        if let Some(Reference { values, unsure }) = references::of(self.name, gap) {
            return Ok((values, [0, 1].map(|k| unsure[k] * values[k].abs())));
        }
        // Films aren't to be held against films.
        let finest = if self.shapes.len() == 1 { 2880 } else { 1440 };
        let of = |faces| self.along(gap * self.size, &panels(faces).films(false));
        let (coarse, fine) = (of(finest / 4)?, of(finest)?);
        let limit = |k: usize| {
            // The error falls with one over the number of faces, about.
            let rest = (fine[k] - coarse[k]) / 3.0;
            (fine[k] + rest, rest.abs())
        };
        let [m, slope] = [limit(0), limit(1)];
        Ok(([m.0, slope.0], [m.1, slope.1]))
    }
}

fn panels(faces: usize) -> Settings {
    let full = Settings::default().fidelity(Fidelity::Full);
    full.method(Method::Panel).faces(faces)
}

fn configurations() -> [(&'static str, Settings); 6] {
    let of = |fidelity| Settings::default().fidelity(fidelity).faces(faces());
    let full = of(Fidelity::Full);
    [
        ("panels, no films", panels(faces()).films(false)),
        ("panels", panels(faces())),
        ("fundamental solutions", full.method(Method::MfsVertex)),
        ("reduced, no films", of(Fidelity::Reduced).films(false)),
        ("reduced", of(Fidelity::Reduced)),
        ("auto", of(Fidelity::Auto)),
    ]
}

/// Cases that the estimates of errors weren't fitted to.
fn held_out() -> Vec<Case> {
    let flat = [[0.0; 3]; 2];
    let case = |name, shapes: &[Shape], turns, closed, size| Case {
        name,
        shapes: shapes.to_vec(),
        turns,
        closed,
        size,
    };
    let turned = |x: f64| [[x, 0.0, 0.0], [0.0; 3]];
    let lying = turned(std::f64::consts::FRAC_PI_2);
    let egg = Shape::ellipsoid([1.0, 0.7, 0.4]);
    let tilted = f64::hypot(0.7 * 0.3_f64.sin(), 0.4 * 0.3_f64.cos());
    let brick = Shape::cuboid([1.0, 0.6, 0.3]);
    let low = 0.3 * 0.1_f64.sin() + 0.15 * 0.1_f64.cos();
    let (large, small) = (Shape::sphere(1.0), Shape::sphere(0.4));
    let long = Shape::ellipsoid([1.0, 0.5, 0.5]);
    let disc = Shape::cylinder(1.0, 0.5);
    let plate = Shape::cuboid([2.5, 2.5, 0.4]);
    let rod = Shape::cylinder(0.4, 2.0);
    let wedge = Shape::prism([[-0.5, -0.2], [0.5, -0.2], [0.3, 0.2], [-0.3, 0.2]], 0.8);
    vec![
        case("egg tilted over a wall", &[egg], turned(0.3), tilted, 0.4),
        case(
            "rod lying over a wall",
            std::slice::from_ref(&rod),
            lying,
            0.4,
            0.4,
        ),
        case("rod upright over a wall", &[rod], flat, 1.0, 0.4),
        case("brick tilted over a wall", &[brick], turned(0.1), low, 0.3),
        case(
            "small sphere over a large one",
            &[small, large],
            flat,
            1.4,
            0.4,
        ),
        case("two long ellipsoids", &[long.clone(), long], flat, 1.0, 0.5),
        case("disc over a plate", &[disc, plate], flat, 0.45, 1.0),
        case("prism over a wall", &[wedge], flat, 0.2, 0.4),
    ]
}

/// Holds the estimates of a run's errors against those: prints all, the least of estimate over error, and the median.
fn estimates(cases: &[Case], gaps: &[f64]) -> Result<()> {
    let of = |fidelity| Settings::default().fidelity(fidelity).faces(faces());
    let configurations = [
        ("reduced, no films", of(Fidelity::Reduced).films(false)),
        ("reduced", of(Fidelity::Reduced)),
        ("auto", of(Fidelity::Auto)),
        ("panels, no films", panels(faces()).films(false)),
        ("panels", panels(faces())),
    ];
    let mut ratios = vec![[Vec::new(), Vec::new()]; configurations.len()];
    for case in cases {
        for gap in gaps {
            let (exact, unsure) = case.converged(*gap)?;
            let gap = gap * case.size;
            let mut line = format!("| {} | {gap:.4} |", case.name);
            for ((_, settings), ratios) in configurations.iter().zip(&mut ratios) {
                let found = case.along(gap, settings);
                let (Ok(found), Ok(Some(said))) = (found, case.estimate(gap, settings)) else {
                    line += " refused |";
                    continue;
                };
                let off = [0, 1].map(|k| found[k] / exact[k] - 1.0);
                for k in 0..2 {
                    // Against nothing that the reference doesn't know better.
                    let sure = (unsure[k] / exact[k]).abs();
                    if off[k].abs() > (3.0 * sure).max([0.003, 0.01][k]) {
                        ratios[k].push(said[k] / off[k].abs());
                    }
                }
                let percent = |x: f64| 100.0 * x;
                line += &format!(
                    " {:+.1} ({:.1}), {:+.1} ({:.1}) |",
                    percent(off[0]),
                    percent(said[0]),
                    percent(off[1]),
                    percent(said[1])
                );
            }
            println!("{line}");
        }
    }
    for ((name, _), ratios) in configurations.iter().zip(&mut ratios) {
        for (what, ratios) in ["M", "slope"].iter().zip(ratios) {
            ratios.sort_by(f64::total_cmp);
            let Some(least) = ratios.first() else {
                continue;
            };
            let (median, count) = (ratios[ratios.len() / 2], ratios.len());
            println!(
                "{name}: {what}: estimate over error {least:.2} at least, {median:.2} at the median of {count}"
            );
        }
    }
    Ok(())
}

/// A sphere over a wall with `reduced` and `auto` at several accuracies: errors of M and of its slope, and what a run estimates that of the slope to be.
fn accuracies(words: &[String]) -> Result<()> {
    println!(
        "| case | gap | accuracy | reduced | auto | time of the force, over the default's |\n|---|---|---|---|---|---|"
    );
    let named = |case: &Case| match words {
        [] => case.name == "sphere-wall",
        words => words.iter().any(|w| case.name.contains(w.as_str())),
    };
    for case in cases().iter().filter(|case| named(case)) {
        for gap in [0.1, 0.05, 0.01, 0.001] {
            let (exact, _) = case.converged(gap)?;
            let mut first = None;
            for accuracy in [None, Some(1e-3), Some(1e-4)] {
                let given = accuracy.map_or("default".into(), |a| format!("{a:.0e}"));
                let mut line = format!("| {} | {gap} | {given} |", case.name);
                let mut times = [0.0; 2];
                for (k, fidelity) in [Fidelity::Reduced, Fidelity::Auto].into_iter().enumerate() {
                    let mut settings = Settings::default().fidelity(fidelity).faces(faces());
                    settings.accuracy = accuracy;
                    let gap = gap * case.size;
                    let found = case.along(gap, &settings)?;
                    let said = case.estimate(gap, &settings)?.map_or(f64::NAN, |e| e[1]);
                    let off = [0, 1].map(|k| 100.0 * (found[k] / exact[k] - 1.0));
                    line += &format!(" {:+.2}, {:+.1} ({:.1}) |", off[0], off[1], 100.0 * said);
                    let simulator = Simulator::new(&case.scene(gap), settings)?;
                    let speed = DVector::from_element(1, 1.0);
                    let mut call = || {
                        let found = simulator.stepper().linearise(simulator.start().0, 0.0)?;
                        found.inertial_force(&speed, &DVector::zeros(0))
                    };
                    times[k] = least(30, &mut [&mut call])?[0];
                }
                let first = *first.get_or_insert(times);
                println!(
                    "{line} {:.1}, {:.1} |",
                    times[0] / first[0],
                    times[1] / first[1]
                );
            }
        }
    }
    Ok(())
}

/// The least seconds of each of several calls, which take turns.
fn least<T>(rounds: usize, calls: &mut [&mut dyn FnMut() -> Result<T>]) -> Result<Vec<f64>> {
    let mut out = vec![f64::INFINITY; calls.len()];
    for _ in 0..rounds {
        for (call, least) in calls.iter_mut().zip(&mut out) {
            let begin = Instant::now();
            std::hint::black_box(call()?);
            *least = least.min(begin.elapsed().as_secs_f64());
        }
    }
    Ok(out)
}

/// What films cost: evaluations of each case with `settings` at a gap where there are some, beside the same without films; and of the case at a gap of 1, where there are none.
fn case_times(cases: &[Case], narrow: f64, settings: &Settings, rounds: usize) -> Result<()> {
    println!(
        "\n| case | value: far, no films, films (ms), films/far | with the force | step | with gradient |\n|---|---|---|---|---|"
    );
    for case in cases {
        let configurations = [(1.0, true), (narrow, false), (narrow, true)];
        let of = |(gap, films): (f64, bool)| {
            Simulator::new(&case.scene(gap * case.size), settings.clone().films(films))
        };
        let simulators = configurations
            .map(of)
            .into_iter()
            .collect::<Result<Vec<_>>>()?;
        let (speed, none) = (DVector::from_element(1, 1.0), DVector::zeros(0));
        let mut line = format!("| {} |", case.name);
        let mut row = |seconds: &[f64]| {
            let ms = |k: usize| 1e3 * seconds[k];
            let times = seconds[2] / seconds[0];
            line += &format!(" {:.3}, {:.3}, {:.3}, {times:.2} |", ms(0), ms(1), ms(2));
        };
        for force in [false, true] {
            let mut calls: Vec<_> = (simulators.iter())
                .map(|simulator| {
                    let (speed, none) = (&speed, &none);
                    move || {
                        let found = simulator.stepper().linearise(simulator.start().0, 0.0)?;
                        match force {
                            true => found.inertial_force(speed, none),
                            false => Ok(found.mass_matrix().column(0).into_owned()),
                        }
                    }
                })
                .collect();
            let mut calls: Vec<&mut dyn FnMut() -> Result<DVector<f64>>> =
                calls.iter_mut().map(|call| call as _).collect();
            row(&least(rounds, &mut calls)?);
        }
        let [mut forward, mut whole] = [vec![f64::INFINITY; 3], vec![f64::INFINITY; 3]];
        for _ in 0..rounds.div_ceil(10) {
            for (k, simulator) in simulators.iter().enumerate() {
                let effort = Effort {
                    steps: 10,
                    repeat: 1,
                };
                let found = step_times(simulator, effort)?;
                forward[k] = forward[k].min(found.forward);
                whole[k] = whole[k].min(found.gradient);
            }
        }
        row(&forward);
        row(&whole);
        println!("{line}");
    }
    Ok(())
}

/// What films cost with `reduced` at a gap of 0.05 and with panels at one of 0.01, and steps of the grippers.
fn times(cases: &[Case], words: &[String], quick: bool) -> Result<()> {
    let rounds = if quick { 50 } else { 400 };
    let reduced = Settings::default()
        .fidelity(Fidelity::Reduced)
        .faces(faces());
    case_times(cases, 0.05, &reduced, rounds)?;
    case_times(cases, 0.01, &panels(faces()), rounds / 10)?;
    println!("\n| scene | step: no films, films (ms), ratio | with gradient |\n|---|---|---|");
    let named = |name: &&str| words.is_empty() || words.iter().any(|w| name.contains(w.as_str()));
    for name in ["grasp", "gripper"].into_iter().filter(named) {
        let Some(scene) = common::scene(name) else {
            continue;
        };
        let [mut forward, mut whole] = [[f64::INFINITY; 2]; 2];
        let of = |films| Simulator::new(&scene, settings("reduced").films(films));
        let simulators = [of(false)?, of(true)?];
        for _ in 0..rounds / 50 {
            for (k, simulator) in simulators.iter().enumerate() {
                let effort = Effort {
                    steps: scene.steps,
                    repeat: 1,
                };
                let found = step_times(simulator, effort)?;
                forward[k] = forward[k].min(found.forward);
                whole[k] = whole[k].min(found.gradient);
            }
        }
        let row = |s: [f64; 2]| format!("{:.3}, {:.3}, {:.2}", 1e3 * s[0], 1e3 * s[1], s[1] / s[0]);
        println!("| {name} | {} | {} |", row(forward), row(whole));
    }
    Ok(())
}

/// Errors of a case, for the picture: of each configuration, at each gap where it answers, of M and of its slope.
struct Errors {
    case: &'static str,
    points: Vec<(usize, f64, [f64; 2])>,
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let (flags, words): (Vec<String>, Vec<String>) =
        arguments().into_iter().partition(|a| a.starts_with("--"));
    let has = |name: &str| flags.iter().any(|f| f == name);
    let quick = has("--quick");
    let gaps = if quick { &QUICK[..] } else { &GAPS[..] };
    let chosen =
        |case: &Case| words.is_empty() || words.iter().any(|w| case.name.contains(w.as_str()));
    let begin = Instant::now();
    if has("--references") {
        references::print(&words);
        println!("\n{:.0} s", begin.elapsed().as_secs_f64());
        return Ok(());
    }
    if has("--accuracy") {
        return Ok(accuracies(&words)?);
    }
    let picked = || {
        cases()
            .into_iter()
            .filter(|c| chosen(c))
            .collect::<Vec<Case>>()
    };
    if has("--time") {
        return Ok(times(&picked(), &words, quick)?);
    }
    if has("--estimates") {
        let chosen = picked();
        println!(
            "| case | gap, m | reduced, no films | reduced | auto | panels, no films | panels |\n|---|---|---|---|---|---|---|"
        );
        estimates(&chosen, gaps)?;
        estimates(&held_out(), &HELD_OUT)?;
        println!("\n{:.0} s", begin.elapsed().as_secs_f64());
        return Ok(());
    }
    let mut all = Vec::new();
    for case in cases().iter().filter(|c| chosen(c)) {
        let mut errors = Errors {
            case: case.name,
            points: Vec::new(),
        };
        let names = configurations().map(|c| c.0);
        println!("\n### {}\n", case.name);
        println!("| gap | M | dM/dgap | {} |", names.join(" | "));
        println!("|{}", "---|".repeat(3 + names.len()));
        for gap in gaps {
            let (exact, unsure) = case.converged(*gap)?;
            let percent = |k: usize| 100.0 * unsure[k] / exact[k].abs();
            let cells =
                configurations().map(|(_, settings)| case.along(gap * case.size, &settings));
            let mut texts = Vec::new();
            for (k, cell) in cells.iter().enumerate() {
                texts.push(match cell {
                    Ok(found) => {
                        let off = [0, 1].map(|i| found[i] / exact[i] - 1.0);
                        errors.points.push((k, *gap, off));
                        format!("{:+.1}, {:+.1}", 100.0 * off[0], 100.0 * off[1])
                    }
                    Err(_) => "refused".into(),
                });
            }
            println!(
                "| {gap} | {:.4} (± {:.1} %) | {:.4} (± {:.1} %) | {} |",
                exact[0],
                percent(0),
                exact[1],
                percent(1),
                texts.join(" | ")
            );
        }
        all.push(errors);
    }
    println!("\n{:.0} s", begin.elapsed().as_secs_f64());
    if has("--plot") {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/gap.svg");
        plot(&file, &all)?;
        println!("wrote {}", file.display());
    }
    Ok(())
}

/// The sizes of the slopes' errors over the gap, a chart a case.
fn plot(file: &Path, all: &[Errors]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    const COLUMNS: usize = 4;
    let rows = all.len().div_ceil(COLUMNS);
    let area = SVGBackend::new(file, (1120, 260 * rows as u32)).into_drawing_area();
    area.fill(&WHITE)?;
    let colors = [GREEN, BLACK, RED, BLUE, MAGENTA, CYAN];
    for (part, errors) in area.split_evenly((rows, COLUMNS)).iter().zip(all) {
        let mut chart = ChartBuilder::on(part)
            .margin(8)
            .caption(errors.case, ("sans-serif", 14))
            .x_label_area_size(28)
            .y_label_area_size(48)
            .build_cartesian_2d((0.0008..1.2).log_scale(), (1e-4..10.0).log_scale())?;
        chart
            .configure_mesh()
            .x_labels(4)
            .y_labels(6)
            .x_desc("gap")
            .y_desc("error of dM/dgap")
            .y_label_formatter(&|y| format!("{y:.0e}"))
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (k, (name, color)) in configurations().iter().map(|c| c.0).zip(colors).enumerate() {
            let mine = errors.points.iter().filter(|p| p.0 == k);
            let points: Vec<(f64, f64)> = mine
                .map(|(_, gap, off)| (*gap, off[1].abs().clamp(1e-4, 10.0)))
                .collect();
            let dots = points.iter().map(|p| Circle::new(*p, 2, color.filled()));
            chart.draw_series(dots)?;
            chart
                .draw_series(LineSeries::new(points.clone(), color.stroke_width(1)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font(("sans-serif", 10))
            .border_style(BLACK.mix(0.2))
            .background_style(WHITE.mix(0.8))
            .draw()?;
    }
    area.present()?;
    Ok(())
}
