//! Many grasps at once (`rollout_batch`), fidelity `reduced`: scene-steps a second on the GPU and on all cores, alone and with their gradients, what each asks
//! of the device by count, and where the time goes.

use super::{PEAKS, argument};
use hydrograd::coupling::SceneSize;
use hydrograd::gpu::batch::{Cost, forward, with_gradient};
use hydrograd::gpu::{Arithmetic, Context};
use hydrograd::simulate::{Backend, BatchReport, Begin, Member};
use hydrograd::{Controls, Fidelity, Rollout, Scene, Settings, Simulator, objective};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Numbers of scenes.
const SCENES: [usize; 4] = [64, 1024, 4096, 16_384];
/// Steps of a rollout, unless others are asked for.
const STEPS: f64 = 10.0;
/// Seconds that it may take, about.
const SECONDS: f64 = 75.0;
/// Rounds of a solve where bodies are apart.
const ROUNDS: f64 = 2.0;
/// Double precision takes so many times as long as single on cards that are made for it.
const DOUBLE: f64 = 2.0;

/// Grasps from nearby starts, pushed at random.
fn members(simulator: &Simulator, count: usize, steps: usize) -> hydrograd::Result<Vec<Member>> {
    let (q, v) = simulator.start();
    let size = simulator.system().controls;
    // Weyl's sequence of the golden ratio, from −1 to 1.
    let number = |i: usize| 2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0;
    let member = |m: usize| {
        let of = |n: usize, at: usize| DVector::from_fn(n, |i, _| number(31 * m + at + i));
        let q = q + 0.02 * of(q.len(), 0);
        let v = v + 0.05 * of(v.len(), 10);
        let pushes = DMatrix::from_fn(size, steps, |i, k| 200.0 * number(7 * m + 3 * k + i));
        Ok(Member {
            begin: Begin::At(q, v),
            controls: Controls::from_matrix(simulator, pushes)?,
        })
    };
    (0..count).map(member).collect()
}

/// Of a batch: seconds and reports of the rollouts, and of their gradients.
struct Run {
    forward: BatchReport,
    gradient: BatchReport,
    failed: usize,
}

fn run_once(simulator: &Simulator, members: &[Member]) -> hydrograd::Result<Run> {
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (made, forward) = simulator.rollout_batch(members, || ControlFlow::Continue(()))?;
    let rollouts: Vec<Rollout> = made.into_iter().filter_map(Result::ok).collect();
    let all: Vec<&Rollout> = rollouts.iter().collect();
    let (bars, gradient) = simulator.gradient_batch(&all, &goal, || ControlFlow::Continue(()))?;
    let lost = bars.iter().filter(|bar| bar.is_err()).count();
    Ok(Run {
        forward,
        gradient,
        failed: members.len() - rollouts.len() + lost,
    })
}

fn simulator(backend: Backend) -> hydrograd::Result<Simulator> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/grasp.toml");
    let scene = match Scene::load(&file) {
        Ok(scene) => scene,
        // A program that was carried elsewhere.
        Err(_) => Scene::load("examples/scenes/grasp.toml")?,
    };
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .backend(backend);
    Simulator::new(&scene, settings)
}

fn told(what: &str, cost: Cost, double: Option<f64>) {
    let bound = double.map_or(String::new(), |peak| {
        let seconds = (cost.fine + cost.single / DOUBLE) / (1e12 * peak);
        format!("; at most {:.2e} a second by operations", 1.0 / seconds)
    });
    println!(
        "{what}: {:.2} Mflop in the fine arithmetic, {:.2} in single precision, {:.1} kB to and fro, {:.0} kB touched{bound}",
        1e-6 * cost.fine,
        1e-6 * cost.single,
        1e-3 * cost.carried,
        1e-3 * cost.touched,
    );
}

fn counts(context: &Context, size: &SceneSize, iterations: f64) {
    println!(
        "\na scene: {} bodies, {} points, {} unknowns, {} columns, {} pairs that see one another, {} entries; {iterations:.1} iterations a solve",
        size.bodies, size.points, size.modes, size.columns, size.pairs, size.entries
    );
    let known = PEAKS
        .iter()
        .find(|(card, _)| context.adapter().name.contains(card));
    let double = known.filter(|_| context.fine() == Arithmetic::Double);
    let double = double.map(|(_, peak)| peak / DOUBLE);
    told("a step", forward(size, ROUNDS, iterations), double);
    told(
        "with its gradient",
        with_gradient(size, ROUNDS, iterations),
        double,
    );
}

/// Of the time of a batch on all groups of seats: what the device computes, what else it is waited for, and packing.
fn shares(report: &BatchReport) -> String {
    let t = &report.together;
    let part = |x: f64| format!("{:.0} %", 100.0 * x / report.seconds);
    let computing = t.computing.unwrap_or(0.0);
    format!(
        "{} | {} | {}",
        t.computing.map_or("–".into(), part),
        part(t.waiting - computing),
        part(t.packing)
    )
}

/// Measures.
///
/// # Errors
/// A device that fails.
pub fn run(context: &Context) -> hydrograd::Result<()> {
    let started = Instant::now();
    let seconds = argument("--seconds").unwrap_or(SECONDS);
    let steps = argument("--steps").unwrap_or(STEPS) as usize;
    let most = argument("--most").unwrap_or(f64::MAX);
    let left = || seconds - started.elapsed().as_secs_f64();
    let (cpu, gpu) = (simulator(Backend::Cpu)?, simulator(Backend::Gpu)?);
    let (mut told, mut last, mut cpu_last) = (false, 0.0, 0.0);
    // Shaders are compiled.
    run_once(&gpu, &members(&gpu, 2, 1)?)?;
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    for count in SCENES.into_iter().filter(|count| *count as f64 <= most) {
        if last * count as f64 > left() {
            println!("| {count} | left out: about {:.0} s |", last * count as f64);
            continue;
        }
        let all = members(&gpu, count, steps)?;
        let begun = Instant::now();
        let on_gpu = run_once(&gpu, &all)?;
        last = begun.elapsed().as_secs_f64() / count as f64;
        if !told {
            let t = &on_gpu.forward.together;
            counts(
                context,
                &t.size,
                t.iterations as f64 / t.evaluations.max(1) as f64,
            );
            println!(
                "\n{steps} steps; {cores} cores; the clock was started {:.1} s ago\n",
                started.elapsed().as_secs_f64()
            );
            println!(
                "| scenes | seats | CPU, scene-steps/s | with gradient | GPU, scene-steps/s | with gradient | GPU/CPU | with gradient | forward: device | transfer | packing | gradient: device | transfer | packing | alone, failed |"
            );
            println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
            told = true;
        }
        let on_cpu = match cpu_last * (count as f64) < 0.5 * left() {
            true => {
                let begun = Instant::now();
                let found = run_once(&cpu, &members(&cpu, count, steps)?)?;
                cpu_last = begun.elapsed().as_secs_f64() / count as f64;
                Some(found)
            }
            false => None,
        };
        let rates = |run: &Run| {
            let done = (count * steps) as f64;
            let whole = run.forward.seconds + run.gradient.seconds;
            [done / run.forward.seconds, done / whole]
        };
        let own = rates(&on_gpu);
        let [beside, ratio] = match on_cpu.as_ref().map(rates) {
            Some(c) => [
                format!("{:.3e} | {:.3e}", c[0], c[1]),
                format!("{:.2} | {:.2}", own[0] / c[0], own[1] / c[1]),
            ],
            None => ["– | –".into(), "– | –".into()],
        };
        println!(
            "| {count} | {} | {beside} | {:.3e} | {:.3e} | {ratio} | {} | {} | {}, {} |",
            on_gpu.forward.seats,
            own[0],
            own[1],
            shares(&on_gpu.forward),
            shares(&on_gpu.gradient),
            on_gpu.forward.together.alone + on_gpu.gradient.together.alone,
            on_gpu.failed,
        );
    }
    println!("\n{:.0} s for batches", started.elapsed().as_secs_f64());
    Ok(())
}
