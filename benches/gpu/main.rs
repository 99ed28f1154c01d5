//! The coupled system on the GPU beside the CPU: steps and their gradients, memory, and how fast pairs are.
//!
//! `cargo bench --features gpu --bench gpu [-- --minutes M] [--peak TFLOPS]`, on whatever adapter there is. First the four scenes
//! of the paper's size with the fidelity `full`: seconds a step (momentum Euler: one evaluation with its derivatives) and seconds
//! a step with its gradient, on both. Then rows of spheres, one of which moves: one evaluation with its derivatives and one
//! second derivative, by fundamental solutions and by coupled panels; between them falling spheres of the fidelity `reduced`. Last, products with K alone: pairs of a face and a source a second, and what share that is of the card's
//! single-precision peak (`--peak`, or of a card known here). What wouldn't end within the minutes given (default 9), or
//! not fit into memory, is left out, with the reason.
//!
//! With `batch` alone (`-- batch [--seconds S] [--steps N] [--most SCENES]`): many equal scenes together, of the size of the grasp.

mod batch;

use hydrograd::adjoint::lie::{Pose, Vec3, Vec6};
use hydrograd::boundary::{BodyBoundary, MfsSettings as BodySettings, PanelBoundary};
use hydrograd::coupling::full::{Cpu, Full, Model, SolveSettings};
use hydrograd::coupling::{Direction, Exclusions, Linearise, PanelCoupled};
use hydrograd::dynamics::Integrator;
use hydrograd::gpu::full::{Gpu, Probe};
use hydrograd::gpu::panel::GpuPanels;
use hydrograd::gpu::{Arithmetic, Context, Options};
use hydrograd::scene::{Body, Fluid, Scene};
use hydrograd::shape;
use hydrograd::simulate::Backend;
use hydrograd::{Controls, Fidelity, Settings, Shape, Simulator, objective};
use nalgebra::{DMatrix, DVector, Matrix3};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

const SCENES: [&str; 4] = [
    "falling_ball_box",
    "grasp_open",
    "fish_near_tail",
    "clown_fish",
];
/// Spheres of this many faces, 642 sources each.
const FACES: usize = 1280;
/// Numbers of spheres: about 10⁴, 5·10⁴ and 10⁵ sources.
const ROWS: [usize; 3] = [16, 78, 156];
/// Spheres of this many panels, and numbers of them: 640 to 19,840 panels.
const PANEL_FACES: usize = 320;
const PANEL_ROWS: [usize; 4] = [2, 8, 27, 62];
/// Numbers of falling spheres, compressed, and the most of which the CPU's factor is timed.
const COMPRESSED_ROWS: [usize; 6] = [2, 8, 27, 64, 125, 216];
const COMPRESSED_CPU: usize = 64;
/// Operations of a pair, square roots and divisions counted once: solid angle, and two a column.
const OPERATIONS: f64 = 105.0;
/// Columns of the products that are timed alone.
const COLUMNS: usize = 12;
/// Products of an evaluation with first and second derivatives, about: iterations of two solves, twice
/// each, and what surrounds them.
const PRODUCTS: f64 = 70.0;
/// Memory that the CPU's matrix may take, bytes.
const MATRIX: f64 = 12e9;
/// Single-precision peak of some cards, TFLOPS, as published.
const PEAKS: [(&str, f64); 5] = [
    ("H200", 66.9),
    ("H100", 66.9),
    ("A100", 19.5),
    ("RTX 4090", 82.6),
    ("RTX 3060", 12.7),
];

fn argument(name: &str) -> Option<f64> {
    let all: Vec<String> = std::env::args().collect();
    let at = all.iter().position(|a| a == name)?;
    all.get(at + 1)?.parse().ok()
}

/// Seconds of a call, the shortest of a few.
fn seconds(repeat: usize, mut call: impl FnMut()) -> f64 {
    let once = |call: &mut dyn FnMut()| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64()
    };
    (0..repeat)
        .map(|_| once(&mut call))
        .fold(f64::INFINITY, f64::min)
}

/// Seconds a step, and a step with its gradient: the least of some rounds, the first of which compiles
/// shaders; more of them, and more steps, where they are quick.
fn step(simulator: &Simulator) -> hydrograd::Result<(f64, f64)> {
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let (mut forward, mut whole) = (f64::INFINITY, f64::INFINITY);
    let all = Instant::now();
    for round in 0.. {
        let steps = if whole < 0.2 { 10 } else { 1 };
        let controls = Controls::zeros(simulator, steps);
        let start = Instant::now();
        let rollout = simulator.rollout(&controls)?;
        let middle = start.elapsed().as_secs_f64();
        rollout.gradient(&goal)?;
        forward = forward.min(middle / steps as f64);
        whole = whole.min(start.elapsed().as_secs_f64() / steps as f64);
        if round >= 4 || round >= 1 && all.elapsed().as_secs_f64() > 5.0 {
            break;
        }
    }
    Ok((forward, whole))
}

/// Seconds that are left, and how fast this adapter makes entries of K.
struct Budget<'a> {
    left: &'a dyn Fn() -> f64,
    rate: f64,
}

impl Budget<'_> {
    /// What an evaluation with first and second derivatives takes, about; `None` if so many of them end
    /// in time.
    fn refuses(&self, pairs: f64, evaluations: f64) -> Option<f64> {
        let expected = PRODUCTS * pairs / self.rate;
        (evaluations * expected > (self.left)()).then_some(expected)
    }
}

fn scenes(budget: &Budget) -> hydrograd::Result<()> {
    println!(
        "\n| scene | faces | unknowns | CPU, ms/step | with gradient | GPU, ms/step | with gradient | CPU/GPU | device, MB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in SCENES {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("examples/scenes/{name}.toml"));
        let scene = Scene::load(file)?;
        let settings = Settings::default()
            .fidelity(Fidelity::Full)
            .integrator(Integrator::MomentumEuler);
        let cpu = Simulator::new(&scene, settings.clone())?;
        let start = format!("| {name} | {} | {} |", cpu.faces(), cpu.unknowns());
        let on_cpu = step(&cpu)?;
        let both = format!("{:.1} | {:.1}", 1e3 * on_cpu.0, 1e3 * on_cpu.1);
        let pairs = (cpu.faces() * cpu.unknowns()) as f64;
        // Two rounds of a step and its gradient, and what compiling takes.
        if let Some(seconds) = budget.refuses(pairs, 3.0) {
            println!("{start} {both} | left out: about {seconds:.0} s a step on this adapter |");
            continue;
        }
        let gpu = Simulator::new(&scene, settings.backend(Backend::Gpu))?;
        let on_gpu = step(&gpu)?;
        let memory = (gpu.backend().device).map_or(0.0, |d| d.peak_memory as f64 / 1e6);
        println!(
            "{start} {both} | {:.1} | {:.1} | {:.2} | {memory:.0} |",
            1e3 * on_gpu.0,
            1e3 * on_gpu.1,
            on_cpu.1 / on_gpu.1,
        );
    }
    Ok(())
}

/// Spheres in a cubic lattice, gaps of half a radius.
fn lattice(count: usize) -> hydrograd::Result<(Arc<Model>, Vec<Pose>)> {
    let mesh = shape::build(&Shape::sphere(0.5), Path::new("."), Some(FACES))?;
    let boundary = BodyBoundary::new("ball", &mesh, &BodySettings::default())?;
    let body = Arc::new(boundary);
    let settings = SolveSettings {
        tolerance: 1e-6,
        ..SolveSettings::default()
    };
    let model = Model::new(vec![body; count], &[], Exclusions::none(), settings)?;
    Ok((Arc::new(model), lattice_poses(count)))
}

fn lattice_poses(count: usize) -> Vec<Pose> {
    let side = (count as f64).cbrt().ceil() as usize;
    let pose = |i: usize| {
        let at = [i % side, i / side % side, i / side / side].map(|n| 1.25 * n as f64);
        Pose::new(Matrix3::identity(), Vec3::from(at))
    };
    (0..count).map(pose).collect()
}

/// One evaluation with its derivatives, and one second derivative.
fn evaluate(full: &dyn Linearise, poses: &[Pose]) -> hydrograd::Result<()> {
    let bodies = poses.len();
    let mut basis = DMatrix::zeros(6 * bodies, 6);
    basis.rows_mut(0, 6).fill_with_identity();
    let record = full.linearise(poses, &basis)?;
    let x = DVector::from_element(6, 1.0);
    let mut z = vec![Vec6::zeros(); bodies];
    z[0] = Vec6::repeat(1.0);
    record.hvp(Direction::Basis(&x), Direction::Basis(&x), &z)?;
    Ok(())
}

fn rows(context: &Arc<Context>, budget: &Budget) -> hydrograd::Result<()> {
    println!("\n| spheres | faces | sources | CPU, s | GPU, s | CPU/GPU | device, MB |");
    println!("|---|---|---|---|---|---|---|");
    for count in ROWS {
        let (model, poses) = lattice(count)?;
        let (faces, sources) = (model.rows() as f64, model.columns() as f64);
        let start = format!("| {count} | {faces} | {sources} |");
        if let Some(seconds) = budget.refuses(faces * sources, 2.0) {
            println!("{start} left out: about {seconds:.0} s on this adapter |");
            continue;
        }
        let gpu = Full::on(model.clone(), Box::new(Gpu::new(context, &model)?));
        let mut result = Ok(());
        let on_gpu = seconds(2, || result = evaluate(&gpu, &poses));
        result?;
        let memory = context.counts().peak_memory as f64 / 1e6;
        let matrix = 8.0 * faces * sources;
        // A matrix as large as that is made in about so many seconds, and read as often as there are products.
        if matrix > MATRIX {
            println!(
                "{start} – (a matrix of {:.0} GB) | {on_gpu:.3} | – | {memory:.0} |",
                matrix / 1e9
            );
            continue;
        }
        let cpu = Full::on(model.clone(), Box::new(Cpu::new(model.clone())?));
        let mut result = Ok(());
        let on_cpu = seconds(1, || result = evaluate(&cpu, &poses));
        result?;
        println!(
            "{start} {on_cpu:.3} | {on_gpu:.3} | {:.2} | {memory:.0} |",
            on_cpu / on_gpu
        );
    }
    Ok(())
}

/// The same by coupled panels.
fn panels(context: &Arc<Context>, budget: &Budget) -> hydrograd::Result<()> {
    println!("\n| spheres, by panels | panels | CPU, s | GPU, s | CPU/GPU | device, MB |");
    println!("|---|---|---|---|---|---|");
    let mesh = shape::build(&Shape::sphere(0.5), Path::new("."), Some(PANEL_FACES))?;
    let body = Arc::new(PanelBoundary::new("ball", &mesh)?);
    let settings = SolveSettings {
        tolerance: 1e-6,
        ..SolveSettings::default()
    };
    for count in PANEL_ROWS {
        let bodies = || vec![body.clone(); count];
        let make = || PanelCoupled::new(bodies(), &[], Exclusions::none(), settings);
        let (cpu, gpu) = (make()?, make()?);
        let n = cpu.model().rows() as f64;
        let start = format!("| {count} | {n} |");
        if let Some(seconds) = budget.refuses(n * n, 2.0) {
            println!("{start} left out: about {seconds:.0} s on this adapter |");
            continue;
        }
        let backend = GpuPanels::new(context, gpu.model())?;
        let gpu = gpu.on(Box::new(backend));
        let poses = lattice_poses(count);
        let mut result = Ok(());
        let on_gpu = seconds(2, || result = evaluate(&gpu, &poses));
        result?;
        let memory = context.counts().peak_memory as f64 / 1e6;
        let mut result = Ok(());
        let on_cpu = seconds(1, || result = evaluate(&cpu, &poses));
        result?;
        println!(
            "{start} {on_cpu:.3} | {on_gpu:.3} | {:.3} | {memory:.0} |",
            on_cpu / on_gpu
        );
    }
    Ok(())
}

/// Compressed spheres (`reduced`) that fall from a lattice: milliseconds a step.
fn compressed(left: &dyn Fn() -> f64) -> hydrograd::Result<()> {
    println!(
        "\n| spheres, `reduced` | CPU, ms/step | with gradient | GPU, ms/step | with gradient | CPU/GPU | device, MB |"
    );
    println!("|---|---|---|---|---|---|---|");
    // A step with its gradient on the CPU and on the GPU, and of how many spheres.
    let (mut cpu_before, mut gpu_before) = ((0.0, 1), (0.0, 1));
    let expected = |(seconds, spheres): (f64, usize), count: usize, power| {
        3.0 * seconds * (count as f64 / spheres as f64).powi(power)
    };
    for count in COMPRESSED_ROWS {
        if expected(gpu_before, count, 2) > left() {
            println!("| {count} | left out |");
            continue;
        }
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.gravity = [0.0, 0.0, -9.81];
        for pose in lattice_poses(count) {
            let ball = Body::new(Shape::sphere(0.5).faces(PANEL_FACES)).density(1100.0);
            scene.add(ball.at(pose.translation.into()));
        }
        let settings = Settings::default()
            .fidelity(Fidelity::Reduced)
            .integrator(Integrator::MomentumEuler);
        let gpu = Simulator::new(&scene, settings.clone().backend(Backend::Gpu))?;
        let on_gpu = step(&gpu)?;
        let memory = (gpu.backend().device).map_or(0.0, |d| d.peak_memory as f64 / 1e6);
        gpu_before = (on_gpu.1, count);
        let cpu = match count <= COMPRESSED_CPU && expected(cpu_before, count, 3) < left() {
            true => {
                let on_cpu = step(&Simulator::new(&scene, settings)?)?;
                cpu_before = (on_cpu.1, count);
                Some(on_cpu)
            }
            false => None,
        };
        let [forward, whole, ratio] = match cpu {
            Some(c) => [
                format!("{:.1}", 1e3 * c.0),
                format!("{:.1}", 1e3 * c.1),
                format!("{:.2}", c.1 / on_gpu.1),
            ],
            None => ["–", "–", "–"].map(String::from),
        };
        println!(
            "| {count} | {forward} | {whole} | {:.1} | {:.1} | {ratio} | {memory:.1} |",
            1e3 * on_gpu.0,
            1e3 * on_gpu.1
        );
    }
    Ok(())
}

/// Pairs a second of products with K.
fn rate(
    context: &Arc<Context>,
    arithmetic: Arithmetic,
    count: usize,
    repeat: usize,
) -> hydrograd::Result<f64> {
    let (model, poses) = lattice(count)?;
    let gpu = Gpu::new(context, &model)?;
    let probe = Probe::new(&gpu, &poses)?;
    let seconds = probe.kernels().time_apply(arithmetic, COLUMNS, repeat)?;
    Ok((model.rows() * model.columns()) as f64 / seconds)
}

fn products(context: &Arc<Context>, budget: &Budget) -> hydrograd::Result<()> {
    let name = &context.adapter().name;
    let peak = argument("--peak").or_else(|| {
        let known = PEAKS.iter().find(|(card, _)| name.contains(card));
        known.map(|(_, peak)| *peak)
    });
    println!(
        "| products with K, {COLUMNS} columns | sources | pairs/s | TFLOPS | share of the peak |"
    );
    println!("|---|---|---|---|---|");
    for (arithmetic, count) in [
        (Arithmetic::Single, 4),
        (Arithmetic::Single, 16),
        (Arithmetic::Single, 78),
        (context.fine(), 4),
        (context.fine(), 16),
    ] {
        let pairs = (FACES * count) as f64 * (FACES * count / 2) as f64;
        let once = pairs / budget.rate;
        if 100.0 * once > (budget.left)() {
            continue;
        }
        let rate = rate(context, arithmetic, count, if once > 0.5 { 1 } else { 20 })?;
        let flops = rate * (OPERATIONS + 2.0 * COLUMNS as f64) / 1e12;
        let share = match (arithmetic, peak) {
            (Arithmetic::Single, Some(peak)) => format!("{:.0} %", 100.0 * flops / peak),
            _ => "–".into(),
        };
        println!(
            "| {} | {} | {rate:.2e} | {flops:.2} | {share} |",
            arithmetic.name(),
            642 * count
        );
    }
    Ok(())
}

fn main() -> hydrograd::Result<()> {
    let start = Instant::now();
    let minutes = argument("--minutes").unwrap_or(9.0);
    let left = || 60.0 * minutes - start.elapsed().as_secs_f64();
    let context = Context::new(&Options::default())?;
    let adapter = context.adapter();
    println!(
        "{} ({}, {}), fine arithmetic: {}\n",
        adapter.name,
        adapter.driver,
        adapter.interface,
        context.fine().name()
    );
    if std::env::args().any(|a| a == "batch") {
        return batch::run(&context);
    }
    let budget = Budget {
        left: &left,
        // Never infinite, however short it was.
        rate: rate(&context, Arithmetic::Single, 2, 20)?.min(1e13),
    };
    products(&context, &budget)?;
    scenes(&budget)?;
    compressed(&left)?;
    panels(&context, &budget)?;
    rows(&context, &budget)?;
    batch::run(&context)?;
    println!("\n{:.0} s in all", start.elapsed().as_secs_f64());
    Ok(())
}
