//! Contact at random: gradients of rollouts through it against differences, and grasps with random forces.
//!
//! `cargo bench --bench contact [-- SECTION …] [--count N] [--integrator NAME] [--parts N]`, sections `gradients` (500 episodes), `grasps` with
//! random forces and `thrown` ones without (1,000); all if none is named. Grasps are stepped by the scene's step over `--parts`, with the integrator that a scene with contact gets or that
//! of `--integrator`.

#[allow(dead_code)]
mod common;
#[allow(dead_code)]
#[path = "../examples/grasp/hold.rs"]
mod hold;
#[allow(dead_code)]
#[path = "../examples/grasp/task.rs"]
mod task;

use common::arguments;
use common::support::CONTACT_INTEGRATORS;
use common::support::falling::drops;
use common::support::grasps::RandomGrasp;
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::Scene;
use hydrograd::simulate::OpenLoop;
use hydrograd::{Controls, Fidelity, Result, Rollout, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::time::Instant;

fn main() {
    let arguments = arguments();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)?.parse::<usize>().ok()
    };
    let has = |name: &str| arguments.iter().any(|a| a == name);
    let all = !["gradients", "grasps", "thrown"].iter().any(|s| has(s));
    if all || has("gradients") {
        gradients(value("--count").unwrap_or(500));
    }
    let kinds = ["grasps", "thrown"].map(|kind| all || has(kind));
    if kinds.contains(&true) {
        let name = arguments.iter().position(|a| a == "--integrator");
        let name = name.and_then(|at| arguments.get(at + 1));
        let integrator = name.map(|name| name.parse().expect("the name of an integrator"));
        let parts = value("--parts").unwrap_or(1);
        grasps(value("--count").unwrap_or(1000), kinds, integrator, parts);
    }
}

/// Two bodies that fall on a floor and on one another, dry or each in water of its own.
struct Episode {
    scene: Scene,
    integrator: Integrator,
    seed: u64,
}

const TIME_STEP: f64 = 5e-3;
/// By then both have landed.
const STEPS: usize = 100;
/// Steps of the differences, of the scale of their direction.
const DIFFERENCES: [f64; 5] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Errors that the table counts.
const LIMITS: [f64; 4] = [1e-3, 1e-4, 1e-5, 1e-6];

/// What came of an episode.
struct Compared {
    /// Of the adjoint against the difference, of the larger of both.
    error: f64,
    /// Whether anything touched.
    touched: bool,
    /// Whether what touches, or into how many pieces steps are cut, is another at an end of the difference.
    changed: bool,
}

fn episodes(count: usize) -> Vec<Episode> {
    let mut thrown = drops(count, TIME_STEP, true).into_iter();
    let mut fallen = drops(count, TIME_STEP, false).into_iter();
    let episode = |k: usize| {
        let pick = if k.is_multiple_of(2) {
            &mut thrown
        } else {
            &mut fallen
        };
        let mut scene = pick.next()?;
        if k % 4 >= 2 {
            scene.fluid.density = 998.0;
            for body in &mut scene.bodies {
                body.density = Some(2700.0);
            }
        }
        Some(Episode {
            scene,
            integrator: CONTACT_INTEGRATORS[k % CONTACT_INTEGRATORS.len()],
            seed: k as u64,
        })
    };
    (0..count).map_while(episode).collect()
}

/// Pairs, of two bodies or of one and a wall.
type Pairs = BTreeSet<(usize, Option<usize>)>;

/// How many pieces each step has, and which pairs touch in it.
fn events(rollout: &Rollout) -> Result<(Vec<usize>, Vec<Pairs>)> {
    let touching = |n: usize| {
        let contacts = rollout.contacts(n, 0.0)?;
        Ok(contacts.iter().map(|c| (c.first, c.second)).collect())
    };
    let touching: Result<Vec<_>> = (0..rollout.steps()).map(touching).collect();
    Ok((rollout.pieces(), touching?))
}

fn compared(episode: &Episode) -> Result<Compared> {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(episode.integrator);
    let mut simulator = Simulator::new(&episode.scene, settings)?;
    let none = Controls::zeros(&simulator, STEPS);
    let mut random = Samples::new(episode.seed);
    let nv = simulator.start().1.len();
    let mut vector = |count: usize, size: f64| DVector::from_vec(random.numbers(count, size));
    // Where bodies end (over a tenth of a metre), and how fast (over a metre per second, a radian per second).
    let (markers, speeds) = (vector(6, 10.0), vector(nv, 1.0));
    let (dq, dv) = (vector(nv, 0.1), vector(nv, 1.0));
    let values = DVector::from_vec(simulator.parameters().to_vec());
    let scaled = vector(values.len(), 0.3).component_mul(&values);
    let (q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
    let parameters = simulator.parameters().clone();

    let rollout = simulator.rollout(&none)?;
    let before = events(&rollout)?;
    let touched = before.1.iter().any(|pairs| !pairs.is_empty());
    let mut cotangents = rollout.zero_cotangents();
    cotangents.positions.set_column(STEPS, &markers);
    cotangents.v.set_column(STEPS, &speeds);
    let gradient = rollout.vjp(&cotangents)?;
    let by_parameters = DVector::from_vec(gradient.parameters.to_vec());
    let adjoint =
        gradient.initial.q.dot(&dq) + gradient.initial.v.dot(&dv) + by_parameters.dot(&scaled);
    drop(rollout);

    let mut at = |h: f64| -> Result<(f64, bool)> {
        let moved = simulator.system().tree.integrate(&q, &(h * &dq));
        simulator.set_start(moved, &v + h * &dv)?;
        let changed = (&values + h * &scaled).as_slice().to_vec();
        let changed = parameters.with_values(&changed).expect("as many values");
        simulator.set_parameters(changed)?;
        let rollout = simulator.rollout(&none)?;
        let end = &rollout.samples()[STEPS];
        let places = end.poses.iter().zip(0..);
        let places: f64 = places
            .map(|(p, b)| p.translation.dot(&markers.fixed_rows::<3>(3 * b)))
            .sum();
        Ok((places + end.v.dot(&speeds), events(&rollout)? != before))
    };
    // Of fourth order; the two that agree best are believed, the finer one is taken.
    let mut found = Vec::new();
    for h in DIFFERENCES {
        let ends = [at(h)?, at(-h)?, at(2.0 * h)?, at(-2.0 * h)?];
        let slope = (8.0 * (ends[0].0 - ends[1].0) - (ends[2].0 - ends[3].0)) / (12.0 * h);
        found.push((slope, ends.iter().any(|e| e.1)));
    }
    let apart = |w: &[(f64, bool)]| (w[0].0 - w[1].0).abs();
    let best = found
        .windows(2)
        .min_by(|a, b| apart(a).total_cmp(&apart(b)));
    let (slope, changed) = best.map_or(found[0], |w| w[1]);
    Ok(Compared {
        error: (adjoint - slope).abs() / adjoint.abs().max(slope.abs()),
        touched,
        changed,
    })
}

fn gradients(count: usize) {
    println!("\n### Gradients of {count} random episodes, {STEPS} steps of {TIME_STEP} s\n");
    let begin = Instant::now();
    let episodes = episodes(count);
    let all: Vec<Result<Compared>> = episodes.par_iter().map(compared).collect();
    let mut failed = 0;
    for (k, error) in all
        .iter()
        .enumerate()
        .filter_map(|(k, r)| Some((k, r.as_ref().err()?)))
    {
        println!("episode {k} fails: {error}");
        failed += 1;
    }
    let ended: Vec<&Compared> = all.iter().flatten().collect();
    let touched = ended.iter().filter(|c| c.touched).count();
    let strange = ended.iter().filter(|c| !c.error.is_finite()).count();
    println!("{failed} fail, {strange} aren't finite; bodies touch in {touched}\n");
    println!(
        "| events at the ends of the difference | episodes | median | 99 % | worst | ≤ 1e-3 | ≤ 1e-4 | ≤ 1e-5 | ≤ 1e-6 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, changed) in [("as in the middle", false), ("others", true)] {
        let mut errors: Vec<f64> = (ended.iter().filter(|c| c.changed == changed))
            .map(|c| c.error)
            .collect();
        errors.sort_by(f64::total_cmp);
        let Some(last) = errors.len().checked_sub(1) else {
            println!("| {name} | 0 | | | | | | | |");
            continue;
        };
        let quantile = |part: f64| errors[(part * last as f64).round() as usize];
        let within = LIMITS.map(|limit| {
            let held = errors.iter().filter(|e| **e <= limit).count();
            format!("{:.1} %", 100.0 * held as f64 / errors.len() as f64)
        });
        println!(
            "| {name} | {} | {:.1e} | {:.1e} | {:.1e} | {} |",
            errors.len(),
            quantile(0.5),
            quantile(0.99),
            quantile(1.0),
            within.join(" | ")
        );
    }
    println!("\n{:.0} s", begin.elapsed().as_secs_f64());
}

/// How a grasp ended.
struct Closed {
    nearest: f64,
    past: f64,
    cut: usize,
    most: usize,
    finite: bool,
    /// The most energy that it held beyond that of the start and what the forces had put in, and the most that it held, J.
    gain: f64,
    energy: f64,
    /// The most of that gain before anything pressed.
    free: f64,
}

/// Steps of the simulator are the grasp's over `parts`.
fn closed(simulator: &Simulator, grasp: &RandomGrasp, parts: usize) -> Result<Closed> {
    let mut simulator = simulator.clone();
    simulator.set_start(grasp.start.clone(), grasp.velocity.clone())?;
    let forces = DMatrix::from_fn(
        grasp.forces.nrows(),
        parts * grasp.forces.ncols(),
        |c, n| grasp.forces[(c, n / parts)],
    );
    let controls = Controls::from_matrix(&simulator, forces)?;
    let rollout = simulator.rollout(&controls)?;
    let summary = rollout.summary();
    let limits = &simulator.system().limits;
    let past = |q: &DVector<f64>| {
        let of = limits.iter().map(|l| l.past(q[l.q]) / l.room());
        of.fold(0.0, f64::max)
    };
    let samples = rollout.samples();
    let finite = |s: &hydrograd::simulate::Sample| s.q.iter().chain(&s.v).all(|x| x.is_finite());
    // Column and fingers slide: a force's work is that over the way of its joint, however the step was cut.
    let (mut work, mut gain, mut energy) = (0.0, 0.0_f64, samples[0].energy());
    let (mut free, mut pressed) = (0.0, false);
    for (n, pair) in samples.windows(2).enumerate() {
        let forces = controls.matrix().column(n);
        let way = |c: usize| pair[1].q[c] - pair[0].q[c];
        work += (0..forces.len()).map(|c| forces[c] * way(c)).sum::<f64>();
        gain = gain.max(pair[1].energy() - samples[0].energy() - work);
        let acts = |c: &hydrograd::dynamics::ContactForce| c.force != [0.0; 3];
        pressed |= rollout.contacts(n, 0.0)?.iter().any(acts) || past(&pair[1].q) > 0.0;
        if !pressed {
            free = gain;
        }
        energy = energy.max(pair[1].energy());
    }
    Ok(Closed {
        nearest: summary.min_gap.unwrap_or(f64::INFINITY),
        past: samples.iter().map(|s| past(&s.q)).fold(0.0, f64::max),
        cut: summary.cut_steps,
        most: summary.most_pieces,
        finite: samples.iter().all(finite),
        gain,
        energy,
        free,
    })
}

/// Grasps of the example with random forces, and the same gripper thrown at the coin without any.
fn grasps(count: usize, kinds: [bool; 2], integrator: Option<Integrator>, parts: usize) {
    let scene = task::load().expect("an example scene");
    let time_step = scene.time_step / parts as f64;
    let settings = Settings {
        integrator,
        ..Settings::default().fidelity(Fidelity::Reduced).films(true)
    };
    let settings = settings.time_step(time_step);
    println!(
        "\n### {count} grasps, steps of {time_step} s, {}, `reduced` with films\n",
        <&str>::from(settings.resolve(&scene).integrator)
    );
    let mut simulator = Simulator::new(&scene, settings).expect("an example scene");
    simulator.set_policy(Box::new(OpenLoop));
    let coin = [hold::COIN_Y, hold::COIN_Z, hold::COIN_TURN];
    let mut random = Samples::new(3);
    let draw = |_| RandomGrasp::draw(&mut random, simulator.start().0, coin, scene.steps);
    let forced: Vec<RandomGrasp> = (0..count).map(draw).collect();
    let thrown = forced.iter().map(|g| g.thrown(&mut random, coin)).collect();
    let both = [("with random forces", forced), ("thrown", thrown)];
    for ((name, drawn), _) in both.into_iter().zip(kinds).filter(|(_, asked)| *asked) {
        ended(name, &simulator, &drawn, parts);
    }
}

fn ended(name: &str, simulator: &Simulator, drawn: &[RandomGrasp], parts: usize) {
    let begin = Instant::now();
    let of = |(k, grasp): (usize, &RandomGrasp)| {
        let end = closed(simulator, grasp, parts);
        // As it comes: a thousand take long.
        if let Err(error) = &end {
            println!("{name}, grasp {k} fails: {error}");
        }
        end
    };
    let ends: Vec<Result<Closed>> = drawn.par_iter().enumerate().map(of).collect();
    let held: Vec<&Closed> = ends.iter().flatten().collect();
    let most = |of: fn(&Closed) -> f64| held.iter().map(|c| of(c)).fold(0.0, f64::max);
    let nearest = held.iter().map(|c| c.nearest).fold(f64::INFINITY, f64::min);
    println!(
        "{name}: {} of {} fail; {} hold something that isn't finite; smallest gap {:.2} mm of {:.0}; at most {:.3} of a range past a limit; {} steps cut, into at most {} \
         pieces; energy gain at most {:.1e} J, {:.1e} of the most that the grasp holds, before anything presses {:.1e}; {:.0} s",
        ends.len() - held.len(),
        ends.len(),
        held.iter().filter(|c| !c.finite).count(),
        1e3 * nearest,
        1e3 * simulator
            .contact_gaps()
            .iter()
            .map(|g| g.gap)
            .fold(0.0, f64::max),
        most(|c| c.past),
        held.iter().map(|c| c.cut).sum::<usize>(),
        most(|c| c.most as f64),
        most(|c| c.gain),
        most(|c| c.gain / c.energy.max(f64::MIN_POSITIVE)),
        most(|c| c.free / c.energy.max(f64::MIN_POSITIVE)),
        begin.elapsed().as_secs_f64()
    );
}
