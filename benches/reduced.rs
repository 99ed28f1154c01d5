//! What the reduced coupling costs, how far that is from the floor, how it grows, and how exact it is.
//!
//! `cargo bench --bench reduced [-- SECTION …] [--quick] [--plot]`, sections `scenes`, `floor`, `sizes`, `spheres`; all of them
//! if none is named. `--quick` leaves out the larger ones. `--plot` writes the last one to docs/two_spheres.svg as well.

#[allow(dead_code)]
mod common;

use common::support::reference::{TwoSpheres, multipoles};
use common::{Effort, arguments, in_child, median, scene, serve_child, settings, step_times};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, Side};
use hydrograd::adjoint::kernel::{Points, Sources, Write, potential_fill};
use hydrograd::adjoint::lie::{Mat3, Pose, Vec3};
use hydrograd::adjoint::sample::Samples;
use hydrograd::boundary::ExactBoundary;
use hydrograd::coupling::Coupling;
use hydrograd::coupling::Direction;
use hydrograd::coupling::reduced::{Reduced, ReducedBody, cache, compress};
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator, shape};
use nalgebra::{DMatrix, DVector};
use plotters::prelude::*;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

const SCENES: [&str; 4] = ["falling_ball", "grasp_open", "fish_near_tail", "clown_fish"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    if serve_child() {
        return Ok(());
    }
    let arguments = arguments();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    let quick = has("--quick");
    let all = arguments.iter().all(|a| a.starts_with("--"));
    if all || has("scenes") {
        scenes(quick)?;
    }
    if all || has("floor") {
        floor(quick)?;
    }
    if all || has("sizes") {
        sizes(quick);
    }
    if all || has("spheres") {
        let curves = spheres(quick)?;
        if has("--plot") {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/two_spheres.svg");
            plot(&file, &curves)?;
            println!("\nwrote {}", file.display());
        }
    }
    Ok(())
}

/// Median seconds of a call: at least three calls, and a fifth of a second of them.
fn time<T>(quick: bool, mut f: impl FnMut() -> T) -> f64 {
    std::hint::black_box(f());
    let enough = if quick { 0.05 } else { 0.2 };
    let (start, mut times) = (Instant::now(), vec![]);
    while times.len() < 3 || (start.elapsed().as_secs_f64() < enough && times.len() < 1000) {
        let start = Instant::now();
        std::hint::black_box(f());
        times.push(start.elapsed().as_secs_f64());
    }
    median(times)
}

/// Steps and gradients of the example scenes, beside `full`.
fn scenes(quick: bool) -> Result<(), Box<dyn std::error::Error>> {
    println!("\n### Scenes\n");
    println!(
        "| scene | configuration | unknowns | setup s | setup s, cached | ms/step | ms/step with gradient | ratio | full/this | peak MB | peak MB, cached |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let chosen = if quick { &SCENES[..2] } else { &SCENES[..] };
    for file in chosen {
        let Some(scene) = scene(file) else { continue };
        let effort = |steps, repeat| match quick {
            true => Effort {
                steps: steps / 5 + 1,
                repeat: 1,
            },
            false => Effort { steps, repeat },
        };
        let full = in_child(file, "full", effort(4, 3), None);
        match &full {
            Ok(r) => println!(
                "| {} | `full` | {} | {:.2} | – | {:.3} | {:.3} | {:.2} | 1 | {:.0} | – |",
                scene.name,
                r.unknowns,
                r.setup,
                1e3 * r.forward,
                1e3 * r.gradient,
                r.gradient / r.forward,
                r.memory
            ),
            Err(e) => println!("| {} | `full` | {e} |||||||||", scene.name),
        }
        for configuration in ["reduced", "auto"] {
            let folder = tempfile::tempdir()?;
            let run = || in_child(file, configuration, effort(50, 5), Some(folder.path()));
            let (cold, warm) = match (run(), run()) {
                (Ok(cold), Ok(warm)) => (cold, warm),
                (Err(e), _) | (_, Err(e)) => {
                    println!("| | `{configuration}` | {e} |||||||||");
                    continue;
                }
            };
            let gain = full
                .as_ref()
                .map_or("–".into(), |f| format!("{:.0}", f.forward / warm.forward));
            println!(
                "| | `{configuration}` ({}) | {} | {:.2} | {:.3} | {:.3} | {:.3} | {:.2} | {gain} | {:.0} | {:.0} |",
                warm.fidelity,
                warm.unknowns,
                cold.setup,
                warm.setup,
                1e3 * warm.forward,
                1e3 * warm.gradient,
                warm.gradient / warm.forward,
                cold.memory,
                warm.memory
            );
        }
    }
    Ok(())
}

/// One evaluation beside the bare linear algebra of the same sizes.
fn floor(quick: bool) -> hydrograd::Result<()> {
    println!("\n### How far from the floor\n");
    println!(
        "| scene | configuration | points | modes | links | kernel ms | products ms | Cholesky ms | sum ms | evaluation ms | evaluation/sum |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let chosen = if quick { &SCENES[..1] } else { &SCENES[..] };
    for file in chosen {
        let Some(scene) = scene(file) else { continue };
        for configuration in ["reduced", "auto"] {
            let simulator = Simulator::new(&scene, settings(configuration))?;
            if !matches!(simulator.fidelity(), Fidelity::Reduced) {
                println!(
                    "| {} | `{configuration}` | chose `{:?}` |||||||||",
                    scene.name,
                    simulator.fidelity()
                );
                continue;
            }
            let mut q = simulator.start().0.clone();
            simulator.stepper().place_motions(&mut q, 0.0);
            let (system, parameters) = (simulator.system(), simulator.parameters());
            system.linearise(parameters, &q, 0.0)?;
            let whole = time(quick, || {
                system
                    .linearise(parameters, &q, 0.0)
                    .map(|e| e.report().clone())
            });
            let links = links(&scene, &simulator);
            let parts = bare(quick, &links, simulator.unknowns());
            let sum: f64 = parts.iter().sum();
            let points: usize = simulator.discretisation().iter().map(|d| d.points).sum();
            println!(
                "| {} | `{configuration}` | {points} | {} | {} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.2} |",
                scene.name,
                simulator.unknowns(),
                links.len(),
                1e3 * parts[0],
                1e3 * parts[1],
                1e3 * parts[2],
                1e3 * sum,
                1e3 * whole,
                whole / sum
            );
        }
    }
    Ok(())
}

/// Points and modes of the two bodies of a block of G.
#[derive(Clone, Copy)]
struct Link {
    points: [usize; 2],
    modes: [usize; 2],
}

/// The blocks of G: every two bodies and every body with its images, but not links that overlap.
fn links(scene: &Scene, simulator: &Simulator) -> Vec<Link> {
    let bodies = simulator.discretisation();
    let images = 1_usize << scene.walls.len();
    let overlap = |child: &str, parent: &str| {
        let body = scene.bodies.iter().find(|b| b.name == child);
        body.is_some_and(|b| b.overlaps_parent && b.parent.as_deref() == Some(parent))
    };
    let mut out = Vec::new();
    for (t, target) in bodies.iter().enumerate() {
        for (s, source) in bodies.iter().enumerate().skip(t) {
            let apart = t != s
                && !overlap(&target.body, &source.body)
                && !overlap(&source.body, &target.body);
            let link = Link {
                points: [target.points, source.points],
                modes: [target.unknowns, source.unknowns],
            };
            out.extend(vec![link; images - usize::from(!apart)]);
        }
    }
    out
}

/// Seconds of the pair kernel, of the products LᵀGL and of one Cholesky factorisation, on as many threads
/// as the evaluation uses.
fn bare(quick: bool, links: &[Link], order: usize) -> [f64; 3] {
    let mut random = Samples::new(1);
    let mut kernels: Vec<_> = links
        .iter()
        .map(|l| {
            let mut cloud = |n, at: f64| -> Vec<Vec3> {
                let shift = Vec3::new(at, 0.0, 0.0);
                (0..n).map(|_| shift + Vec3::from(random.array())).collect()
            };
            let targets = Points::bare(&cloud(l.points[0], 0.0));
            let sources = Sources::new(&cloud(l.points[1], 4.0));
            (targets, sources, vec![0.0; l.points[0] * l.points[1]])
        })
        .collect();
    let kernel = time(quick, || {
        kernels.par_iter_mut().for_each(|(targets, sources, out)| {
            let stride = sources.len();
            potential_fill(targets, sources, Write::Set, out, stride, 0);
        })
    });
    let mut matrices: Vec<_> = links
        .iter()
        .zip(&kernels)
        .map(|(l, (_, _, g))| {
            let mut dense = |r, c| Mat::from_fn(r, c, |_, _| random.number());
            let left = dense(l.points[0], l.modes[0] + 6);
            let right = dense(l.points[1], l.modes[1] + 6);
            let half = Mat::<f64>::zeros(l.points[0], right.ncols());
            let out = Mat::<f64>::zeros(left.ncols(), right.ncols());
            (left, right, g, half, out)
        })
        .collect();
    let products = time(quick, || {
        matrices
            .par_iter_mut()
            .for_each(|(left, right, g, half, out)| {
                let g = MatRef::from_row_major_slice(g, left.nrows(), right.nrows());
                let add = Accum::Replace;
                matmul(half.as_mut(), add, g, right.as_ref(), 1.0, Par::Seq);
                matmul(
                    out.as_mut(),
                    add,
                    left.transpose(),
                    half.as_ref(),
                    1.0,
                    Par::Seq,
                );
            })
    });
    let system = Mat::from_fn(
        order,
        order,
        |i, j| {
            if i == j { 1.0 } else { 0.1 / order as f64 }
        },
    );
    let cholesky = time(quick, || system.llt(Side::Lower).expect("definite"));
    [kernel, products, cholesky]
}

/// Growth with the faces of the mesh, with the rank, and with the number of bodies.
fn sizes(quick: bool) {
    let base = Settings::default().fidelity(Fidelity::Reduced);
    let round = || Shape::sphere(0.1);
    // Without symmetry, so that no spin leaves the water at rest.
    let uneven = || Shape::ellipsoid([0.1, 0.07, 0.05]);
    println!("\n### Faces of the mesh (two ellipsoids 10 : 7 : 5)\n");
    heading("faces a body | one-body method");
    for (method, name, meshes) in [
        (Method::Panel, "panel", &[320, 1280, 5120][..]),
        (Method::Exact, "exact", &[320, 1280, 5120, 20480][..]),
    ] {
        for faces in meshes {
            if quick && (*faces > 1280 || method == Method::Exact) {
                continue;
            }
            let settings = base.faces(*faces).method(method);
            let label = format!("{faces} | {name}");
            growth(quick, &label, &swarm(2, uneven), settings);
        }
    }
    println!("\n### Rank (two spheres, a gap of one radius; modes for a tolerance of 1e-6)\n");
    heading("points asked for");
    for rank in [20, 40, 80, 160, 320] {
        if quick && rank > 80 {
            continue;
        }
        let settings = base.accuracy(1e-6).rank(rank);
        growth(quick, &rank.to_string(), &swarm(2, round), settings);
    }
    println!("\n### Number of bodies (spheres on a jittered grid, gaps about one radius)\n");
    heading("bodies | configuration");
    for bodies in [2, 4, 8, 16, 32, 64] {
        if quick && bodies > 16 {
            continue;
        }
        for (name, fidelity) in [("reduced", Fidelity::Reduced), ("auto", Fidelity::Auto)] {
            let label = format!("{bodies} | `{name}`");
            let scene = swarm(bodies, round);
            growth(quick, &label, &scene, base.fidelity(fidelity));
        }
    }
}

fn heading(what: &str) {
    let title = format!(
        "| {what} | points | unknowns | setup s | evaluation ms | ∇E ms | hvp ms | ms/step | ms/step with gradient | ratio |"
    );
    println!("{title}");
    println!("{}|", "|---".repeat(title.matches('|').count() - 1));
}

/// Free bodies of radius 0.1 m about three radii apart, on a grid of the smallest cube that holds them.
fn swarm(bodies: usize, shape: impl Fn() -> Shape) -> Scene {
    let side = (1..).find(|n: &usize| n.pow(3) >= bodies).unwrap_or(1);
    let mut random = Samples::new(7);
    let mut scene = Scene::new(Fluid::fresh_water());
    for i in 0..bodies {
        let cell = [i % side, i / side % side, i / side / side];
        let at = cell.map(|c| 0.3 * c as f64 + 0.015 * random.number());
        let body = Body::new(shape()).density(998.0).at(at);
        scene.add(body.named(format!("body {i}")));
    }
    scene
}

/// One row; what goes wrong is told in it.
fn growth(quick: bool, label: &str, scene: &Scene, settings: Settings) {
    match grown(quick, scene, settings) {
        Ok(figures) => println!("| {label} | {figures} |"),
        Err(e) => println!("| {label} | {e} |||||||||"),
    }
}

fn grown(quick: bool, scene: &Scene, settings: Settings) -> hydrograd::Result<String> {
    cache::forget();
    let start = Instant::now();
    let mut simulator = Simulator::new(scene, settings)?;
    let setup = start.elapsed().as_secs_f64();
    // Nothing at rest: zeros would save work.
    let mut random = Samples::new(3);
    let q = simulator.start().0.clone();
    let v = DVector::from_fn(simulator.start().1.len(), |_, _| 0.01 * random.number());
    simulator.set_start(q.clone(), v.clone())?;
    let (system, parameters) = (simulator.system(), simulator.parameters());
    let evaluation = system.linearise(parameters, &q, 0.0)?;
    let evaluate = time(quick, || {
        system
            .linearise(parameters, &q, 0.0)
            .map(|e| e.report().clone())
    });
    let [mut gradient, mut hvp] = [0.0; 2];
    if let Some(fluid) = evaluation.fluid() {
        gradient = time(quick, || fluid.gradient(&v, &v));
        let along = vec![hydrograd::adjoint::lie::Vec6::repeat(0.1); scene.bodies.len()];
        let direction = Direction::Basis(&v);
        hvp = time(quick, || fluid.hvp(direction, direction, &along));
    }
    let effort = match (quick, evaluate > 0.02) {
        (true, _) => Effort {
            steps: 2,
            repeat: 1,
        },
        (false, true) => Effort {
            steps: 3,
            repeat: 3,
        },
        (false, false) => Effort {
            steps: 20,
            repeat: 5,
        },
    };
    let times = step_times(&simulator, effort)?;
    let (forward, whole) = (times.forward, times.gradient);
    let points: usize = simulator.discretisation().iter().map(|d| d.points).sum();
    Ok(format!(
        "{points} | {} | {setup:.2} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.2}",
        simulator.unknowns(),
        1e3 * evaluate,
        1e3 * gradient,
        1e3 * hvp,
        1e3 * forward,
        1e3 * whole,
        whole / forward
    ))
}

/// Error against gap for one number of points; gaps without an answer are left out.
struct Curve {
    rank: usize,
    points: Vec<(f64, f64)>,
}

/// Error of two spheres, max |ΔM_ij| / √(M_ii M_jj), against the gap in radii.
fn spheres(quick: bool) -> hydrograd::Result<Vec<Curve>> {
    println!("\n### Two exact spheres: error of M_f against the gap\n");
    let gaps = [4.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01];
    let ranks = if quick {
        &[20, 80][..]
    } else {
        &[20, 40, 80, 160, 320][..]
    };
    let title: String = gaps.iter().map(|g| format!(" {g} R |")).collect();
    println!("| points a sphere |{title}");
    println!("|---|{}", "---|".repeat(gaps.len()));
    let mesh = shape::build(&Shape::sphere(1.0), Path::new(""), Some(1280))?;
    // The smallest gap that is resolved on a unit sphere.
    let finest = compress::finest_gap(4.0 * PI);
    let mut curves = Vec::new();
    for rank in ranks {
        let mut last: Option<(f64, Arc<ReducedBody>)> = None;
        let (mut row, mut points) = (String::new(), Vec::new());
        for gap in gaps {
            let resolved = f64::max(gap, finest).min(1.0);
            let body = match last.take().filter(|(g, _)| *g == resolved) {
                Some((_, body)) => body,
                None => sphere(&mesh, *rank, resolved)?,
            };
            let error = two_spheres_error(&body, gap);
            row += &match &error {
                Ok(e) => format!(" {e:.1e} |"),
                Err(_) => " refused |".into(),
            };
            points.extend(error.ok().map(|e| (gap, e)));
            last = Some((resolved, body));
        }
        println!("| {rank} |{row}");
        curves.push(Curve {
            rank: *rank,
            points,
        });
    }
    println!(
        "\nEach gap with spheres compressed for it, but no finer than {finest:.3} R and no coarser than 1 R."
    );
    Ok(curves)
}

fn sphere(mesh: &hydrograd::TriMesh, rank: usize, gap: f64) -> hydrograd::Result<Arc<ReducedBody>> {
    let response = ExactBoundary::new("sphere", [1.0; 3], &Pose::identity(), gap)?;
    let settings = compress::CompressSettings {
        rank: Some(rank),
        tolerance: 1e-8,
        resolved_gap: Some(gap),
    };
    let body = compress::compress("sphere", mesh, &response, &settings, &[])?;
    Ok(Arc::new(body))
}

fn two_spheres_error(body: &Arc<ReducedBody>, gap: f64) -> hydrograd::Result<f64> {
    let pair = Reduced::new(vec![body.clone(); 2], &[], |_, _| None)?;
    let at = |z| Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, z));
    let record = pair.evaluate(&[at(0.0), at(2.0 + gap)], &DMatrix::identity(12, 12))?;
    let m = record.momenta();
    let exact = multipoles(2.0 + gap);
    let found = TwoSpheres::coefficients_of(m);
    let size = [exact[0], exact[0], exact[2], exact[2]];
    let errors = (0..4).map(|i| (found[i] - exact[i]).abs() / size[i]);
    Ok(errors.fold(0.0, f64::max))
}

/// Log–log, one line a number of points.
fn plot(file: &Path, curves: &[Curve]) -> Result<(), Box<dyn std::error::Error>> {
    let errors = || curves.iter().flat_map(|c| c.points.iter().map(|p| p.1));
    let low = errors().fold(1.0, f64::min).max(1e-16);
    let high = errors().fold(0.0, f64::max);
    let area = SVGBackend::new(file, (640, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .caption("two spheres: error of the added mass", ("sans-serif", 15))
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(
            (0.009..5.0).log_scale(),
            (0.5 * low..2.0 * high).log_scale(),
        )?;
    chart
        .configure_mesh()
        .x_desc("gap, radii")
        .y_desc("max |ΔM_ij| / √(M_ii M_jj)")
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let colors = [RED, MAGENTA, BLUE, GREEN, BLACK];
    for (curve, color) in curves.iter().zip(colors) {
        let dots = curve
            .points
            .iter()
            .map(|p| Circle::new(*p, 3, color.filled()));
        chart.draw_series(dots)?;
        chart
            .draw_series(LineSeries::new(curve.points.clone(), color.stroke_width(2)))?
            .label(format!("{} points", curve.rank))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE)
        .draw()?;
    area.present()?;
    Ok(())
}
