//! Bodies that feel each other: a step, its gradient, iterations, memory and errors against their number, by products and by the factor.

use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::coupling::scattering::{Goal, Levels, Motions, Own, Scattering};
use hydrograd::dynamics::Integrator;
use hydrograd::objective::Objective;
use hydrograd::scene::{Body, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::simulate::{Backend, Exchange};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator, objective};
use nalgebra::DVector;
use std::ops::ControlFlow;
use std::time::Instant;

const ACCURACY: f64 = 0.01;
const STEP: f64 = 0.01;
/// Steps of each measurement, the first of which isn't counted, and bodies up to which the factor is measured beside.
const STEPS: usize = 5;
const BY_FACTOR: usize = 64;
const SIZES: [usize; 7] = [2, 4, 16, 64, 256, 1024, 4096];

#[derive(Clone, Copy)]
pub enum Kind {
    Spheres,
    Ellipsoids,
    /// With edges: of many more points than the others.
    Boxes,
    Fish,
}

/// What is measured, by the names that they are asked for with; the last has joints.
pub const KINDS: [(Kind, &str); 4] = [
    (Kind::Spheres, "spheres"),
    (Kind::Ellipsoids, "ellipsoids"),
    (Kind::Boxes, "boxes"),
    (Kind::Fish, "fish"),
];

/// On a jittered grid with gaps of about a radius, `count` bodies; of fish three links each.
fn scene(kind: Kind, count: usize, seed: u64) -> Scene {
    let mut drawn = Samples::new(seed);
    let mut scene = Scene::new(Fluid::fresh_water());
    let groups = match kind {
        Kind::Fish => count.div_ceil(3),
        _ => count,
    };
    let side = (groups as f64).cbrt().ceil() as usize;
    let pitch = match kind {
        Kind::Fish => [0.8, 0.3, 0.3],
        _ => [0.3; 3],
    };
    let mut v = Vec::new();
    for k in 0..groups {
        let cell = [k % side, k / side % side, k / side / side];
        let jitter = Vec3::from(drawn.vector(0.015));
        let at: [f64; 3] = std::array::from_fn(|i| pitch[i] * cell[i] as f64 + jitter[i]);
        let shape = match kind {
            Kind::Spheres => Shape::sphere(0.1),
            Kind::Ellipsoids => Shape::ellipsoid([0.1, 0.05, 0.07]),
            Kind::Boxes => Shape::cuboid([0.16, 0.1, 0.06]),
            Kind::Fish => Shape::ellipsoid([0.1, 0.02, 0.06]),
        };
        let link = || Body::new(shape.clone().faces(320)).density(1100.0);
        let name = format!("{k}");
        scene.add(link().named(name.clone()).at(at));
        v.extend((0..6).map(|_| 0.1 * drawn.number()));
        if let Kind::Fish = kind {
            for (i, x) in [-0.22, 0.22].into_iter().enumerate() {
                let joint = Joint::Revolute {
                    axis: [0.0, 0.0, 1.0],
                };
                let mut fin = link()
                    .named(format!("{k} {i}"))
                    .at([x, 0.0, 0.0])
                    .joint(joint);
                fin.parent = Some(name.clone());
                fin.motion = Some(vec![Motion::Sine {
                    amplitude: 0.3,
                    frequency: 1.0,
                    phase: 0.5 * drawn.number(),
                    offset: 0.0,
                }]);
                scene.add(fin);
                v.push(0.0);
            }
        }
    }
    scene.initial.v = v;
    scene
}

struct Measured {
    rollout: Rollout,
    prepared: f64,
    forward: f64,
    whole: f64,
}

/// The CPU, unless `gpu` is asked for.
fn backend() -> Backend {
    match std::env::args().any(|argument| argument == "gpu") {
        true => Backend::Gpu,
        false => Backend::Cpu,
    }
}

/// Seconds from one to the next. What a rollout and a sweep back begin and end with is no step.
fn between(ends: &[Instant]) -> f64 {
    match ends {
        [first, .., last] => last.duration_since(*first).as_secs_f64() / (ends.len() - 1) as f64,
        _ => 0.0,
    }
}

fn measured(scene: &Scene, exchange: Exchange, gradient: bool) -> hydrograd::Result<Measured> {
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(exchange)
        .backend(backend())
        .films(false)
        .integrator(Integrator::Rk2)
        .accuracy(ACCURACY)
        .time_step(STEP);
    let start = Instant::now();
    let simulator = Simulator::new(scene, settings)?;
    let prepared = start.elapsed().as_secs_f64();
    let controls = Controls::zeros(&simulator, STEPS);
    let mut ends = Vec::with_capacity(STEPS);
    let mut stepped = |_| {
        ends.push(Instant::now());
        ControlFlow::Continue(())
    };
    let rollout = simulator.rollout_from(&simulator.initial()?, &controls, &mut stepped)?;
    let forward = between(&ends);
    let mut whole = forward;
    if gradient {
        ends.clear();
        let mut stepped = |_| {
            ends.push(Instant::now());
            ControlFlow::Continue(())
        };
        let goal = objective::final_velocity(0, 0.0, 1.0);
        rollout.vjp_with(&goal.cotangents(&rollout), &mut stepped)?;
        whole += between(&ends);
    }
    Ok(Measured {
        rollout,
        prepared,
        forward,
        whole,
    })
}

/// Accelerations over the run, m/s² and rad/s².
fn accelerations(rollout: &Rollout) -> DVector<f64> {
    let samples = rollout.samples();
    (&samples[STEPS].v - &samples[0].v) / (STEP * STEPS as f64)
}

/// Most memory of this process so far, bytes; none where the system doesn't tell.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024.0 * kilobytes)
}

/// The table of steps against the number of bodies, up to `most`, of the kinds that are asked for.
pub fn sizes(most: usize, asked: impl Fn(&str) -> bool) -> hydrograd::Result<()> {
    println!(
        "\n{ACCURACY} asked for, RK2, {} threads, backend {:?}; memory is the process's peak so far over that at the start, for each point of a body\n\n| bodies | | points | ms to prepare | ms a step | with gradient | of a step | kB a point | by the factor: times as long | with gradient | accelerations differ by |\n|---|---|---|---|---|---|---|---|---|---|---|",
        rayon::current_num_threads(),
        backend()
    );
    let before = peak();
    for (kind, name) in KINDS {
        if !asked(name) {
            continue;
        }
        let mut last: Option<(usize, f64)> = None;
        for count in SIZES.into_iter().filter(|n| *n <= most) {
            let scene = scene(kind, count, 7);
            let found = measured(&scene, Exchange::Products, true)?;
            let simulator = found.rollout.simulator();
            let many = simulator.system().coupling.scattering();
            let points: usize =
                many.map_or(0, |m| m.reduced_bodies().iter().map(|b| b.points()).sum());
            let memory = peak()
                .zip(before)
                .map(|(now, before)| (now - before) / 1e3 / points as f64);
            let beside = match count <= BY_FACTOR {
                false => "– | – | –".to_string(),
                true => {
                    let other = measured(&scene, Exchange::Factor, true)?;
                    let (a, b) = (accelerations(&found.rollout), accelerations(&other.rollout));
                    format!(
                        "{:.2} | {:.2} | {:.1e}",
                        other.forward / found.forward,
                        other.whole / found.whole,
                        (a - &b).norm() / b.norm()
                    )
                }
            };
            println!(
                "| {} | {name} | {points} | {:.0} | {:.1} | {:.1} | {:.2} | {} | {beside} |",
                scene.bodies.len(),
                1e3 * found.prepared,
                1e3 * found.forward,
                1e3 * found.whole,
                found.whole / found.forward,
                memory.map_or("–".into(), |m| format!("{m:.1}")),
            );
            if let Some((n, ms)) = last
                && count >= 1024
            {
                let exponent = (found.forward / ms).ln() / (count as f64 / n as f64).ln();
                println!("exponent from {n} to {count}: {exponent:.2}");
            }
            last = Some((count, found.forward));
        }
    }
    Ok(())
}

/// Twists of bodies as they are.
struct Free;

impl Motions for Free {
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        coefficients.clone()
    }

    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64> {
        impulses.clone()
    }
}

/// Iterations of the system in which momenta are given, and of that in which twists are, for 64 spheres.
pub fn iterations() -> hydrograd::Result<()> {
    println!(
        "\n| gap, radii | recoil at half the water's density | as dense | 8 times | twists given |\n|---|---|---|---|---|"
    );
    let scene = scene(Kind::Spheres, 2, 1);
    let simulator = Simulator::new(
        &scene,
        Settings::default()
            .fidelity(Fidelity::Reduced)
            .exchange(Exchange::Products)
            .films(false)
            .resolved_gap(0.02),
    )?;
    let Some(made) = simulator.system().coupling.scattering() else {
        return Ok(());
    };
    let body = made.reduced_bodies()[0].clone();
    for gap in [2.0, 1.0, 0.5, 0.2] {
        let mut drawn = Samples::new(9);
        let pitch = 0.1 * (2.0 + gap);
        let at = |k: usize| pitch * Vec3::new((k % 4) as f64, (k / 4 % 4) as f64, (k / 16) as f64);
        let poses: Vec<Pose> = (0..64)
            .map(|k| Pose::new(exp_matrix(&Vec3::from(drawn.vector(0.5))), at(k)))
            .collect();
        let names = (0..64).map(|k| k.to_string()).collect();
        let model = Scattering::new(
            vec![body.clone(); 64],
            names,
            &poses,
            Levels::for_accuracy(1e-3)?,
        )?;
        let first = DVector::from_fn(6 * 64, |_, _| 0.5 * drawn.number());
        let mut row = Vec::new();
        for density in [0.5, 1.0, 8.0] {
            let placed = model.place(&poses, Box::new(Free))?;
            let volume = body.parts().volume;
            let inertia = move |i: usize| match i % 6 {
                0..3 => density * volume,
                _ => 0.4 * density * volume * 0.01,
            };
            let whole = move |i: usize| inertia(i) + if i % 6 < 3 { 0.5 * volume } else { 0.0 };
            let scale = DVector::from_fn(6 * 64, |i, _| whole(i).sqrt());
            let recoil = |h: &DVector<f64>| DVector::from_fn(h.len(), |i, _| h[i] / whole(i));
            let own = Own {
                scale: &scale,
                recoil: &recoil,
                films: false,
            };
            placed.recoil(&first, None, &own, Goal::Full);
            placed.check()?;
            row.push(placed.report().iterations.to_string());
        }
        let placed = model.place(&poses, Box::new(Free))?;
        placed.respond(&first);
        placed.check()?;
        row.push(placed.report().iterations.to_string());
        println!("| {gap} | {} |", row.join(" | "));
    }
    Ok(())
}

/// The largest error of accelerations against the factor over random configurations of 64 bodies, and the largest change of the total momentum.
pub fn errors(configurations: u64) -> hydrograd::Result<()> {
    let [free @ .., _] = KINDS;
    let (mut worst, mut kept) = ([0.0_f64; KINDS.len() - 1], 0.0_f64);
    for seed in 0..configurations {
        let of = seed as usize % free.len();
        let scene = scene(free[of].0, 64, 100 + seed);
        let found = measured(&scene, Exchange::Products, false)?;
        let other = measured(&scene, Exchange::Factor, false)?;
        let (a, b) = (accelerations(&found.rollout), accelerations(&other.rollout));
        worst[of] = worst[of].max((a - &b).norm() / b.norm());
        let samples = found.rollout.samples();
        let change = (samples[STEPS].momentum - samples[0].momentum).amax();
        kept = kept.max(change / samples[0].largest_momentum.amax());
    }
    println!("\n{configurations} configurations of 64 bodies at {ACCURACY}:");
    for ((_, name), worst) in free.iter().zip(worst) {
        println!("accelerations of {name} differ from the factor's by up to {worst:.1e}");
    }
    println!("total momentum changes by up to {kept:.1e} of the largest");
    Ok(())
}
