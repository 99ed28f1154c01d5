//! Gains of a gripper's controller, tuned by gradients through the water.
//!
//! Two fingers close from 0.8 m to 0.55 m around a coin, in 1.5 s; half a second later the coin should still be where it was along
//! the fingers, and in the middle between them. The water that they press out carries it away, so the gripper has to follow. Its controller is
//! `Follow`: proportional and derivative on the three actuated joints, with the coin's speed fed forward to the column. The task
//! ends before anything touches the coin: there the cost is smooth in the gains, and its gradient means what it says. For
//! gradients through contacts see `multiple_shooting`. The time step is 0.02 s, the fidelity `reduced`.
//!
//! The controller sees where the coin is, as a camera would, but not how fast it moves: that is *estimated*. A `Policy` is a pure
//! function of what it observes, without a memory in which positions could be filtered, so the estimate is a model: the water between the
//! fingers leaves towards their tips at a speed that grows with the distance from the column, `v̂ = c · along · closing speed /
//! opening`, and the coin goes with it. In two dimensions, far from the tips, c would be 1; here the fingers are half as wide as long,
//! most of the water leaves sideways, and c is a gain like the others.
//!
//! Untuned are the gains that would be right on dry land: both motions critically damped at 3 rad/s for the masses of the bodies, no feed-forward.
//! Tuned are those of the lowest mean cost over some starts of the coin, found by L-BFGS (`optimize::minimise`) with the exact gradient of each
//! rollout. Both are then tried on starts that the descent hasn't seen.
//!
//! Measured, on two cores: 15 iterations, 20 evaluations of 4 starts in 11 s; mean cost 26.7 untuned and 0.16 tuned on these, 26.4 and 0.12
//! on 8 unseen ones, where the coin leaves its place by up to 34 mm untuned and 2.8 mm tuned; nothing touches in any run.
//!
//! ```text
//! cargo run --release --example controller_tuning -- [--iterations N] [--training N] [--unseen N] [--check]
//!     [--out FILE.svg] [--json]
//! ```
//!
//! `--check` holds the gradient at the untuned gains against central differences.

#[path = "controller_tuning/follow.rs"]
mod follow;

use follow::{COIN_Y, COIN_Z, COLUMN, Follow, LOWER, OPENING, UPPER};
use hydrograd::optimize::{self, OptimizeSettings, Optimum, minimise};
use hydrograd::simulate::{Cotangents, Observation, Policy, Rollout, Sample};
use hydrograd::{Controls, Fidelity, Scene, Settings, Simulator};
use plotters::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use rayon::prelude::*;
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Twice the scene's own, which is short for contact, s.
const TIME_STEP: f64 = 0.02;
const STEPS: usize = 100;
/// Where the coin starts: y (m from the column), z (m) and turn (rad), each between two values.
const STARTS: [[f64; 2]; 3] = [[1.25, 1.5], [-0.02, 0.02], [0.2, 0.6]];
/// Seed of the starts.
const SEED: u64 = 7;

/// What would be a tolerable miss: of lengths, m, of speeds, m/s, and of forces, N.
const LENGTH: f64 = 0.01;
const SPEED: f64 = 0.05;
const FORCE: f64 = 1000.0;

/// Cost of a rollout, with its derivatives over what is observed, and over the gains where forces depend on them directly.
///
/// In squares of tolerable misses: along the fingers as the mean over all states; at the end also the opening, the middle, and
/// the speeds of the coin along the fingers and of the fingers; and the mean force.
fn cost(rollout: &Rollout, along: f64) -> hydrograd::Result<(f64, Cotangents, Vec<f64>)> {
    let samples = rollout.samples();
    let policy = rollout.simulator().policy();
    let mut bar = rollout.zero_cotangents();
    let mut gains = vec![0.0; policy.gains().len()];
    let mut sum = 0.0;
    let states = samples.len() as f64;
    let end = samples.len() - 1;
    let mut term = |n: usize, value: f64, weight: f64, q: &[(usize, f64)], v: &[(usize, f64)]| {
        sum += weight * value * value;
        for (i, part) in q {
            bar.q[(*i, n)] += 2.0 * weight * value * part;
        }
        for (i, part) in v {
            bar.v[(*i, n)] += 2.0 * weight * value * part;
        }
    };
    let place = LENGTH.powi(-2);
    let still = SPEED.powi(-2);
    for (n, s) in samples.iter().enumerate() {
        let miss = s.q[COIN_Y] - s.q[COLUMN] - along;
        term(
            n,
            miss,
            place / states,
            &[(COIN_Y, 1.0), (COLUMN, -1.0)],
            &[],
        );
    }
    let (q, v) = (&samples[end].q, &samples[end].v);
    let wide = q[UPPER] - q[LOWER] - OPENING[1];
    term(end, wide, place, &[(UPPER, 1.0), (LOWER, -1.0)], &[]);
    let aside = q[COIN_Z] - 0.5 * (q[LOWER] + q[UPPER]);
    let parts = [(COIN_Z, 1.0), (LOWER, -0.5), (UPPER, -0.5)];
    term(end, aside, place, &parts, &[]);
    let slip = v[COIN_Y] - v[COLUMN];
    term(end, slip, still, &[], &[(COIN_Y, 1.0), (COLUMN, -1.0)]);
    for i in [LOWER, UPPER] {
        term(end, v[i], still, &[], &[(i, 1.0)]);
    }
    // Forces are the controller's: their cotangent goes through it, to what it observed and to its gains.
    let weight = FORCE.powi(-2) / rollout.controls().len() as f64;
    for (n, s) in samples[..end].iter().enumerate() {
        sum += weight * s.control.norm_squared();
        let back = policy.act_vjp(&observation(rollout, n), &(2.0 * weight * &s.control))?;
        for i in 0..s.v.len() {
            bar.q[(i, n)] += back.q[i];
            bar.v[(i, n)] += back.v[i];
        }
        for (g, b) in gains.iter_mut().zip(&back.gains) {
            *g += b;
        }
    }
    Ok((sum, bar, gains))
}

/// What the controller saw at a step.
fn observation(rollout: &Rollout, step: usize) -> Observation<'_> {
    let s = &rollout.samples()[step];
    Observation {
        step,
        time: s.time,
        time_step: rollout.simulator().time_step(),
        q: &s.q,
        v: &s.v,
        mode: 0,
    }
}

/// A start of the coin, with a simulator of its own: starts run at the same time.
struct Trial {
    simulator: Simulator,
    untuned: Follow,
}

/// What came of a start.
#[derive(Clone, Serialize)]
struct Outcome {
    cost: f64,
    /// Largest miss of the coin along the fingers, mm.
    worst_miss_mm: f64,
    /// Smallest gap between any two bodies, m.
    nearest: f64,
    /// Steps during which anything touched.
    touching: usize,
    /// Miss along the fingers at all states, mm.
    #[serde(skip)]
    misses: Vec<f64>,
}

impl Trial {
    fn new(scene: &Scene, [y, z, turn]: [f64; 3]) -> hydrograd::Result<Self> {
        let half = 0.5 * OPENING[0];
        let mut scene = scene.clone();
        scene.initial.q = vec![0.0, -half, half, y, z, turn];
        let settings = Settings::default()
            .fidelity(Fidelity::Reduced)
            .time_step(TIME_STEP);
        let simulator = Simulator::new(&scene, settings)?;
        let mass = |b| simulator.parameters().mass(b);
        let untuned = Follow::on_dry_land(y, mass(0) + mass(1) + mass(2), mass(1));
        Ok(Self { simulator, untuned })
    }

    fn run<T>(
        &mut self,
        x: &[f64],
        read: impl FnOnce(&Rollout, &Follow) -> hydrograd::Result<T>,
    ) -> hydrograd::Result<T> {
        let policy = self.untuned.with_gains(&self.untuned.at(x))?;
        self.simulator.set_policy(policy);
        let none = Controls::zeros(&self.simulator, STEPS);
        read(&self.simulator.rollout(&none)?, &self.untuned)
    }

    /// Cost and gradient over x.
    fn evaluate(&mut self, x: &[f64]) -> hydrograd::Result<(f64, Vec<f64>)> {
        self.run(x, |rollout, untuned| {
            let (value, bar, direct) = cost(rollout, untuned.along)?;
            let mut gains = rollout.vjp(&bar)?.gains;
            for (g, d) in gains.iter_mut().zip(&direct) {
                *g += d;
            }
            Ok((value, untuned.at_vjp(x, &gains)))
        })
    }

    fn outcome(&mut self, x: &[f64]) -> hydrograd::Result<Outcome> {
        self.run(x, |rollout, untuned| {
            let miss = |s: &Sample| 1e3 * (s.q[COIN_Y] - s.q[COLUMN] - untuned.along);
            let misses: Vec<f64> = rollout.samples().iter().map(miss).collect();
            let mut touching = 0;
            for n in 0..rollout.steps() {
                touching += usize::from(!rollout.contacts(n, 0.0)?.is_empty());
            }
            let gaps = rollout.gaps().iter().flatten().map(|g| g.distance);
            Ok(Outcome {
                cost: cost(rollout, untuned.along)?.0,
                worst_miss_mm: misses.iter().fold(0.0, |m, x| x.abs().max(m)),
                nearest: gaps.fold(f64::INFINITY, f64::min),
                touching,
                misses,
            })
        })
    }
}

/// Mean cost and gradient over all starts.
fn mean(trials: &mut [Trial], x: &[f64]) -> hydrograd::Result<(f64, Vec<f64>)> {
    let count = trials.len() as f64;
    let all: Vec<_> = trials
        .par_iter_mut()
        .map(|t| t.evaluate(x))
        .collect::<hydrograd::Result<_>>()?;
    let mut out = (0.0, vec![0.0; x.len()]);
    for (value, gradient) in all {
        out.0 += value / count;
        for (o, g) in out.1.iter_mut().zip(&gradient) {
            *o += g / count;
        }
    }
    Ok(out)
}

fn outcomes(trials: &mut [Trial], x: &[f64]) -> hydrograd::Result<Vec<Outcome>> {
    trials.par_iter_mut().map(|t| t.outcome(x)).collect()
}

/// Untuned and tuned on the same starts.
#[derive(Serialize)]
struct Compared {
    untuned_cost: f64,
    tuned_cost: f64,
    untuned: Vec<Outcome>,
    tuned: Vec<Outcome>,
}

impl Compared {
    fn new(trials: &mut [Trial], found: &[f64]) -> hydrograd::Result<Self> {
        let (untuned, tuned) = (outcomes(trials, &[0.0; 6])?, outcomes(trials, found)?);
        let mean = |o: &[Outcome]| o.iter().map(|o| o.cost).sum::<f64>() / o.len() as f64;
        Ok(Self {
            untuned_cost: mean(&untuned),
            tuned_cost: mean(&tuned),
            untuned,
            tuned,
        })
    }

    fn print(&self, name: &str) {
        let miss = |o: &[Outcome]| o.iter().map(|o| o.worst_miss_mm).fold(0.0, f64::max);
        println!(
            "{:2} {name} starts: mean cost {:.2} untuned, {:.2} tuned; coin off its place by at most {:.1} mm, {:.1} mm; touching in {} steps",
            self.tuned.len(),
            self.untuned_cost,
            self.tuned_cost,
            miss(&self.untuned),
            miss(&self.tuned),
            self.tuned
                .iter()
                .chain(&self.untuned)
                .map(|o| o.touching)
                .sum::<usize>()
        );
    }
}

#[derive(Serialize)]
struct Report {
    training: Compared,
    unseen: Compared,
    untuned_gains: Vec<f64>,
    tuned_gains: Vec<f64>,
    /// Mean cost on training starts after each iteration.
    history: Vec<f64>,
    iterations: usize,
    evaluations: usize,
    failures: usize,
    stop: optimize::Stop,
    seconds: f64,
}

struct Options {
    iterations: usize,
    training: usize,
    unseen: usize,
    check: bool,
    out: PathBuf,
    json: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let began = Instant::now();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/grasp.toml");
    let mut scene = Scene::load(&file)?;
    scene.controller = None;
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut trials = Vec::new();
    for _ in 0..options.training + options.unseen {
        let mut start = [0.0; 3];
        for (x, [from, to]) in start.iter_mut().zip(STARTS) {
            *x = Uniform::new(from, to)?.sample(&mut random);
        }
        trials.push(Trial::new(&scene, start)?);
    }
    let mut unseen = trials.split_off(options.training);
    if options.check {
        check(&mut trials)?;
    }
    let (found, history) = tune(&mut trials, options.iterations)?;
    let untuned = trials[0].untuned;
    let report = Report {
        training: Compared::new(&mut trials, &found.x)?,
        unseen: Compared::new(&mut unseen, &found.x)?,
        untuned_gains: untuned.gains(),
        tuned_gains: untuned.at(&found.x).to_vec(),
        history,
        iterations: found.iterations,
        evaluations: found.evaluations,
        failures: found.failures,
        stop: found.stop,
        seconds: began.elapsed().as_secs_f64(),
    };
    plot(&options.out, &report)?;
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let names = [
        "column: stiffness, N/m",
        "column: damping, N s/m",
        "column: feed-forward c",
        "fingers: stiffness, N/m",
        "fingers: damping, N s/m",
        "fingers: centring",
    ];
    for (name, (before, after)) in
        (names.iter()).zip(report.untuned_gains.iter().zip(&report.tuned_gains))
    {
        println!("{name:24} {before:9.2} untuned {after:9.2} tuned");
    }
    report.training.print("training");
    report.unseen.print("unseen");
    println!(
        "{} rollouts with gradient in {} evaluations, {:.0} s; wrote {}",
        report.evaluations * options.training,
        report.evaluations,
        report.seconds,
        options.out.display()
    );
    Ok(())
}

/// The lowest mean cost, and the costs on the way; a line per iteration on standard error.
fn tune(trials: &mut [Trial], iterations: usize) -> hydrograd::Result<(Optimum, Vec<f64>)> {
    let start = [0.0; 6];
    let settings = OptimizeSettings {
        iterations,
        first_step: Some(0.3),
        cost_tolerance: 1e-3,
        ..OptimizeSettings::default()
    };
    let mut history = Vec::new();
    let found = minimise(
        |x| mean(trials, x),
        &start,
        &settings,
        |p| {
            eprintln!(
                "iteration {:2}: mean cost {:9.4}, |gradient| {:9.3e}, {} evaluations",
                p.iteration, p.cost, p.gradient, p.evaluations
            );
            history.push(p.cost);
        },
    )?;
    Ok((found, history))
}

/// Adjoint against central differences, each number of x in turn, off the untuned gains, where none of them is zero.
fn check(trials: &mut [Trial]) -> hydrograd::Result<()> {
    let at = [0.1, -0.1, 0.5, 0.2, 0.1, 0.5];
    let (_, gradient) = mean(trials, &at)?;
    for i in 0..at.len() {
        let mut shifted = |h: f64| {
            let mut x = at;
            x[i] += h;
            mean(trials, &x).map(|(value, _)| value)
        };
        let h = 1e-4;
        let difference = (shifted(h)? - shifted(-h)?) / (2.0 * h);
        eprintln!(
            "x[{i}]: adjoint {:+.8e}, difference {difference:+.8e}",
            gradient[i]
        );
    }
    Ok(())
}

fn options() -> Result<Options, String> {
    let mut out = Options {
        iterations: 15,
        training: 4,
        unseen: 8,
        check: false,
        out: "controller_tuning.svg".into(),
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
            "--iterations" => out.iterations = count(value()?)?,
            "--training" => out.training = count(value()?)?,
            "--unseen" => out.unseen = count(value()?)?,
            "--check" => out.check = true,
            "--out" => out.out = value()?.into(),
            "--json" => out.json = true,
            _ => {
                return Err(format!(
                    "{name}: expected --iterations, --training, --unseen, --check, --out or --json"
                ));
            }
        }
    }
    Ok(out)
}

/// Miss of the coin along the fingers against time, unseen starts.
fn plot(file: &Path, report: &Report) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (640, 360)).into_drawing_area();
    area.fill(&WHITE)?;
    let groups = [
        ("untuned", &report.unseen.untuned, RED),
        ("tuned", &report.unseen.tuned, BLUE),
    ];
    let all = groups.iter().flat_map(|(_, o, _)| o.iter());
    let (low, high) = all
        .flat_map(|o| &o.misses)
        .fold((0.0_f64, 0.0_f64), |(l, h), x| (l.min(*x), h.max(*x)));
    let margin = 0.08 * (high - low).max(1e-6);
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .caption(
            "coin along the fingers, mm from its place; unseen starts",
            ("sans-serif", 15),
        )
        .x_label_area_size(28)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..STEPS as f64 * TIME_STEP, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (name, outcomes, color) in groups {
        for (k, outcome) in outcomes.iter().enumerate() {
            let misses = outcome.misses.iter().enumerate();
            let points = misses.map(|(n, m)| (n as f64 * TIME_STEP, *m));
            let line = chart.draw_series(LineSeries::new(points, &color))?;
            if k == 0 {
                line.label(name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color));
            }
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE)
        .draw()?;
    area.present()?;
    Ok(())
}
