//! A long way through contacts, where gradients explode: descent in one piece, with clipped gradients, and in segments.
//!
//! A ball sinks through rows of round pegs and is to be in a given place after 3.2 s, steered by a weak force along and across: 16 spans of
//! 0.2 s, 32 numbers. Every bounce off a peg spreads neighbouring paths, so after 3 s a place changes two thousand times as much as the start did,
//! and the gradient says so: it's exact, and it holds in a tiny neighbourhood only. Three ways are given the same number of
//! simulations of the whole time, each with its gradient:
//!
//! - *single*: the forces are the unknowns, the whole time is one rollout, `optimize::minimise`;
//! - *clipped*: the same with gradients shortened to a tenth of the first one (`optimize::OptimizeSettings::clip`);
//! - *multiple*: every span is a segment, and the segments' start states are unknowns as well. Each segment is a rollout of its own, through
//!   which derivatives can't grow much; that it ends where the next one starts is asked for by an augmented Lagrangian, whose multipliers and weight are
//!   renewed round by round. Once no segment ends far from the next one's start, segments are joined two by two, until they are one piece: the
//!   rest is *single* from there, and costs are those of one rollout of the whole time. A simulation is one of all segments.
//!
//! *multiple* stands on the units of its unknowns: with forces in 0.05 N in place of 0.4 N it got within 10 mm at one of four targets,
//! in 400 simulations.
//!
//! Measured, on two cores, in 27 s: *multiple* hits the target (0.0 mm), *single* and *clipped* end 23 and 25 mm off. It depends on the target:
//! at this and five others (`--target` 0.45,-1.0; 0.3,-1.05; 0.2,-1.1; 0.4,-0.9; 0.1,-1.4) *multiple* ends within 3.5 mm at all six; *single* within
//! 1 mm at two and 23 to 241 mm off at four; *clipped* within 8 mm at two and 25 to 114 mm off at four.
//!
//! ```text
//! cargo run --release --example multiple_shooting -- [--simulations N] [--target X,Y] [--json]
//! ```

#[path = "multiple_shooting/segments.rs"]
mod segments;

use hydrograd::optimize::{OptimizeSettings, minimise};
use hydrograd::scene::{Contact, Plane};
use hydrograd::simulate::Rollout;
use hydrograd::{
    Body, Controls, Fidelity, Fluid, Gradient, Joint, Scene, Settings, Shape, Simulator,
};
use nalgebra::DMatrix;
use segments::Segments;
use serde::Serialize;
use std::error::Error;
use std::time::Instant;

/// Time step, s; spans of constant force, a power of two, and steps of each.
const TIME_STEP: f64 = 0.005;
const SPANS: usize = 16;
const PART: usize = 40;
/// Where the ball should be at the end if nothing else is said, m.
const TARGET: [f64; 2] = [0.2, -1.0];
/// A tolerable miss at the end, m, and the force whose mean square costs as much as that, N.
const MISS: f64 = 0.02;
const FORCE: f64 = 0.5;
/// Units of the unknowns: force, N; place, m, and speed, m/s, of a segment's start.
const FORCE_UNIT: f64 = 0.4;
const PLACE: f64 = 0.02;
const SPEED: f64 = 0.1;
/// Longest gradient of *clipped*, in multiples of the first one.
const CLIP: f64 = 0.1;
/// Length of the first trial step in these units, and the shortest that is worth another start.
const FIRST_STEP: f64 = 0.2;
const SHORTEST: f64 = 1e-7;
/// Weight of defects in the first round and its growth from round to round.
const WEIGHT: f64 = 10.0;
const GROWTH: f64 = 3.0;
/// Simulations of a round.
const ROUND: usize = 40;
/// Largest defect, in its unit, at which segments are joined.
const TOGETHER: f64 = 0.05;
/// Part of all simulations that is kept for the end in one piece: one in so many.
const POLISH: usize = 8;

fn simulator() -> hydrograd::Result<Simulator> {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, -9.81, 0.0];
    scene.time_step = TIME_STEP;
    // Soft enough for a bounce to take some ten steps, so that it is differentiable in fact as well as by its formula.
    scene.contact = Some(Contact {
        stiffness: Some(3000.0),
        dissipation: 0.2,
        friction: 0.0,
        ..Contact::default()
    });
    let ball = Body::new(Shape::sphere(0.05)).density(1300.0);
    scene.add(ball.joint(Joint::Planar { plane: Plane::Xy }).actuated());
    for row in 0..6 {
        for column in -1..=1 {
            let x = 0.4 * (f64::from(column) + 0.5 * f64::from(row % 2));
            let peg = Body::new(Shape::sphere(0.1)).at([x, -0.4 * f64::from(row + 1), 0.0]);
            scene.add(peg.fixed());
        }
    }
    scene.initial.q = vec![0.03, -0.15, 0.0];
    scene.initial.v = vec![0.0, -0.3, 0.0];
    // The ball's own added mass: what pegs do to it through the water is left out, contacts are what matters here.
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(&scene, settings.faces(80))
}

/// Place and velocity: x, y, v_x, v_y. A ball without friction doesn't turn.
type State = [f64; 4];
const UNITS: State = [PLACE, PLACE, SPEED, SPEED];

/// Forces over and across, two per segment in units of [`FORCE_UNIT`].
const FORCES: usize = 2 * SPANS;

/// Rollout with forces that are constant over each `PART` steps.
fn rollout(simulator: &Simulator, forces: &[f64]) -> hydrograd::Result<Rollout> {
    let steps = forces.len() / 2 * PART;
    let force = |i: usize, n: usize| match i {
        0 | 1 => FORCE_UNIT * forces[n / PART * 2 + i],
        _ => 0.0,
    };
    let controls = DMatrix::from_fn(3, steps, force);
    simulator.rollout(&Controls::from_matrix(simulator, controls)?)
}

/// Cotangent of the forces from that of the controls.
fn forces_bar(gradient: &Gradient) -> Vec<f64> {
    let parts = gradient.controls.ncols() / PART;
    let part = |k: usize| gradient.controls.columns(k * PART, PART);
    let sum = |k: usize, i: usize| FORCE_UNIT * part(k).row(i).sum();
    (0..2 * parts).map(|j| sum(j / 2, j % 2)).collect()
}

fn end(rollout: &Rollout) -> State {
    let s = &rollout.samples()[rollout.steps()];
    [s.q[0], s.q[1], s.v[0], s.v[1]]
}

/// Gradient of a scalar of the end.
fn from_end(rollout: &Rollout, end_bar: State) -> hydrograd::Result<Gradient> {
    let mut bar = rollout.zero_cotangents();
    let last = rollout.steps();
    for i in 0..2 {
        bar.q[(i, last)] = end_bar[i];
        bar.v[(i, last)] = end_bar[2 + i];
    }
    rollout.vjp(&bar)
}

/// What the end costs, with its derivative.
fn miss(end: State, target: [f64; 2]) -> (f64, State) {
    let [x, y] = [end[0] - target[0], end[1] - target[1]];
    let weight = MISS.powi(-2);
    (
        weight * (x * x + y * y),
        [2.0 * weight * x, 2.0 * weight * y, 0.0, 0.0],
    )
}

/// What forces cost, with its derivative.
fn effort(forces: &[f64]) -> (f64, Vec<f64>) {
    let weight = (FORCE_UNIT / FORCE).powi(2) / FORCES as f64;
    let sum: f64 = forces.iter().map(|f| f * f).sum();
    (
        weight * sum,
        forces.iter().map(|f| 2.0 * weight * f).collect(),
    )
}

/// One rollout of the whole time: cost and gradient.
fn whole(
    simulator: &Simulator,
    target: [f64; 2],
    forces: &[f64],
) -> hydrograd::Result<(f64, Vec<f64>)> {
    let rollout = rollout(simulator, forces)?;
    let (cost, end_bar) = miss(end(&rollout), target);
    let (more, mut gradient) = effort(forces);
    let back = forces_bar(&from_end(&rollout, end_bar)?);
    for (g, b) in gradient.iter_mut().zip(&back) {
        *g += b;
    }
    Ok((cost + more, gradient))
}

/// How a way went.
#[derive(Serialize)]
struct Way {
    name: &'static str,
    /// Least cost of a rollout of the whole time so far, after each simulation; infinite before there is one.
    best: Vec<f64>,
    /// Distance from the target at the end, m.
    miss: f64,
    /// Root of the mean square of the forces, N.
    force: f64,
    seconds: f64,
}

impl Way {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            best: Vec::new(),
            miss: f64::NAN,
            force: f64::NAN,
            seconds: 0.0,
        }
    }

    /// Notes a simulation, and the cost of the whole time if it gave one.
    fn note(&mut self, cost: Option<f64>) {
        let so_far = self.best.last().copied().unwrap_or(f64::INFINITY);
        self.best.push(cost.map_or(so_far, |c| c.min(so_far)));
    }

    fn end(
        mut self,
        simulator: &Simulator,
        target: [f64; 2],
        x: &[f64],
        began: Instant,
    ) -> hydrograd::Result<Self> {
        let end = end(&rollout(simulator, x)?);
        self.miss = (end[0] - target[0]).hypot(end[1] - target[1]);
        self.force = FORCE * effort(x).0.sqrt();
        self.seconds = began.elapsed().as_secs_f64();
        let best = self.best[self.best.len() - 1];
        eprintln!(
            "{}: cost {best:.3e} after {} simulations",
            self.name,
            self.best.len()
        );
        Ok(self)
    }
}

/// In one piece from `start`, for as many simulations as are left: where the search gives up it starts again from its best point with
/// a first step a tenth as long.
fn single(
    way: &mut Way,
    simulator: &Simulator,
    target: [f64; 2],
    start: &[f64],
    clip: Option<f64>,
    simulations: usize,
) -> hydrograd::Result<Vec<f64>> {
    let mut x = start.to_vec();
    let mut first_step = FIRST_STEP;
    while way.best.len() < simulations && first_step > SHORTEST {
        let settings = OptimizeSettings {
            evaluations: simulations - way.best.len(),
            iterations: simulations,
            first_step: Some(first_step),
            clip,
            ..descent()
        };
        let evaluate = |x: &[f64]| {
            let out = whole(simulator, target, x);
            way.note(out.as_ref().ok().map(|(cost, _)| *cost));
            out
        };
        x = minimise(evaluate, &x, &settings, |_| {})?.x;
        first_step *= 0.1;
    }
    Ok(x)
}

fn descent() -> OptimizeSettings {
    OptimizeSettings {
        first_step: Some(FIRST_STEP),
        cost_tolerance: 1e-6,
        memory: 40,
        ..OptimizeSettings::default()
    }
}

/// In segments that are pulled together and joined two by two, until they are one piece.
fn multiple(
    way: &mut Way,
    simulator: &Simulator,
    target: [f64; 2],
    start: &[f64],
    simulations: usize,
) -> hydrograd::Result<Vec<f64>> {
    let mut segments = Segments::new(simulator, target)?;
    // They start where the unsteered ball passes: no defects.
    let unsteered = rollout(simulator, start)?;
    way.note(None);
    let mut x = start.to_vec();
    for k in 1..SPANS {
        let s = &unsteered.samples()[k * PART];
        let state = [s.q[0], s.q[1], s.v[0], s.v[1]];
        x.extend((0..4).map(|i| state[i] / UNITS[i]));
    }
    let last = simulations - simulations / POLISH;
    while segments.len() > 1 && way.best.len() + ROUND <= last {
        // One of a round's simulations is that of the update.
        let settings = OptimizeSettings {
            evaluations: ROUND - 1,
            ..descent()
        };
        let evaluate = |x: &[f64]| {
            way.note(None);
            segments.evaluate(x)
        };
        let found = minimise(evaluate, &x, &settings, |_| {})?;
        x = found.x;
        way.note(None);
        let defect = segments.update(&x)?;
        eprintln!(
            "multiple: {:3} simulations, {:2} segments, cost {:.3e}, largest defect {defect:.1e}",
            way.best.len(),
            segments.len(),
            found.cost
        );
        if defect < TOGETHER {
            x = segments.join(&x);
        }
    }
    x.truncate(FORCES);
    single(way, simulator, target, &x, None, simulations)
}

/// How much faster the place changes than that at the start: the largest derivative, second by second.
fn growth(simulator: &Simulator) -> hydrograd::Result<Vec<(f64, f64)>> {
    let rollout = rollout(simulator, &[0.0; FORCES])?;
    let each = (1.0 / TIME_STEP) as usize;
    let mut out = Vec::new();
    for n in (each..=rollout.steps()).step_by(each) {
        let mut largest = 0.0_f64;
        for i in 0..2 {
            let mut bar = rollout.zero_cotangents();
            bar.q[(i, n)] = 1.0;
            largest = largest.max(rollout.vjp(&bar)?.initial.q.amax());
        }
        out.push((rollout.samples()[n].time, largest));
    }
    Ok(out)
}

#[derive(Serialize)]
struct Report {
    /// s, and largest derivative of the place over that at the start.
    growth: Vec<(f64, f64)>,
    cost_at_start: f64,
    simulations: usize,
    ways: Vec<Way>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let Options {
        simulations,
        target,
        json,
    } = options()?;
    let simulator = simulator()?;
    let start = vec![0.0; FORCES];
    let one = |name, clip| -> hydrograd::Result<Way> {
        let (mut way, began) = (Way::new(name), Instant::now());
        let x = single(&mut way, &simulator, target, &start, clip, simulations)?;
        way.end(&simulator, target, &x, began)
    };
    // At the same time: a rollout of one ball keeps one core busy.
    let (free, clipped) = rayon::join(|| one("single", None), || one("clipped", Some(CLIP)));
    let mut ways = vec![free?, clipped?];
    let (mut way, began) = (Way::new("multiple"), Instant::now());
    let x = multiple(&mut way, &simulator, target, &start, simulations)?;
    ways.push(way.end(&simulator, target, &x, began)?);
    let report = Report {
        growth: growth(&simulator)?,
        cost_at_start: ways[0].best[0],
        simulations,
        ways,
    };
    if json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    for (time, factor) in &report.growth {
        println!(
            "after {time:.0} s a place changes by up to {factor:.3e} of a change of the start"
        );
    }
    println!("unsteered: cost {:.3e}", report.cost_at_start);
    for w in &report.ways {
        let last = w.best[w.best.len() - 1];
        println!(
            "{:8}  cost {last:.3e} after {} simulations; {:.1} mm off, force {:.3} N; {:.0} s",
            w.name,
            w.best.len(),
            1e3 * w.miss,
            w.force,
            w.seconds
        );
    }
    Ok(())
}

struct Options {
    simulations: usize,
    target: [f64; 2],
    json: bool,
}

fn options() -> Result<Options, String> {
    let mut out = Options {
        simulations: 240,
        target: TARGET,
        json: false,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{name} needs a value"));
        match name.as_str() {
            "--simulations" => {
                let text = value()?;
                out.simulations = match text.parse() {
                    Ok(n) if n >= 100 => n,
                    _ => return Err(format!("{text}: not a number of at least 100")),
                };
            }
            "--target" => {
                let text = value()?;
                let numbers: Vec<f64> = text.split(',').flat_map(str::parse).collect();
                out.target = match *numbers {
                    [x, y] if x.is_finite() && y.is_finite() => [x, y],
                    _ => return Err(format!("{text}: not X,Y in m")),
                };
            }
            "--json" => out.json = true,
            _ => {
                return Err(format!(
                    "{name}: expected --simulations, --target or --json"
                ));
            }
        }
    }
    Ok(out)
}
