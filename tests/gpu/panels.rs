//! Coupled panels on the device against the CPU's.

use super::coupled::rungs;
use super::fixture::*;
use super::kernels::{Entry, LIMITS, Products, TWO, close, columns};
use crate::support::mesh;
use hydrograd::Error;
use hydrograd::adjoint::kernel::{
    Sources, Triangles, Write, double_fill, double_hvp, double_vjp, flux_fill, single_hvp,
    single_sum, single_vjp,
};
use hydrograd::adjoint::lie::{Mat3, Mat6, Pose, Vec3, Vec6, angular, linear, six};
use hydrograd::boundary::PanelBoundary;
use hydrograd::coupling::full::{FullSolver, SolveSettings};
use hydrograd::coupling::{
    Coupling, Exclusions, ExtrapolatedPanels, Linearise, PanelCoupled, PanelModel,
};
use hydrograd::gpu::panel::{GpuPanels, Probe};
use hydrograd::gpu::probe::Kernels;
use hydrograd::gpu::{Arithmetic, Context};
use hydrograd::scene::{Shape, Wall, WallSurface};
use hydrograd::solver::Columns;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::sync::Arc;

const FREE: Wall = Wall {
    surface: WallSurface::Free,
    ..SIDE
};
const FLOOR: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [0.0, 0.0, 0.0],
    normal: [0.0, 0.0, 1.0],
};

fn panels(shape: &Shape, faces: usize) -> Arc<PanelBoundary> {
    Arc::new(PanelBoundary::new("b", &mesh(shape, faces)).unwrap())
}

/// Three bodies, two of one shape, none of whose sizes is a multiple of a block; a box has sharp edges.
fn three() -> Vec<Arc<PanelBoundary>> {
    let ball = panels(&Shape::sphere(0.5), 80);
    let cuboid = panels(&Shape::cuboid([0.9, 0.5, 0.6]), 100);
    vec![ball.clone(), cuboid, ball]
}

fn tight(tolerance: f64) -> SolveSettings {
    SolveSettings {
        tolerance,
        ..SolveSettings::default()
    }
}

/// What makes a coupling, twice: on the CPU to round-off, and on a device.
fn both(
    context: &Arc<Context>,
    tolerance: f64,
    make: impl Fn(SolveSettings) -> PanelCoupled,
) -> [PanelCoupled; 2] {
    [make(tight(1e-13)), on(context, make(tight(tolerance)))]
}

fn on(context: &Arc<Context>, coupled: PanelCoupled) -> PanelCoupled {
    let gpu = GpuPanels::new(context, coupled.model()).unwrap();
    coupled.on(Box::new(gpu))
}

fn of(bodies: &[Arc<PanelBoundary>], walls: &[Wall], settings: SolveSettings) -> PanelCoupled {
    PanelCoupled::new(bodies.to_vec(), walls, Exclusions::none(), settings).unwrap()
}

fn holds(what: &str, pair: [&dyn Linearise; 2], poses: &[Pose], columns: usize, limit: f64) {
    let found = rungs(pair, poses, &basis(poses.len(), columns, 0.3));
    println!("{what}: value, gradient, along, vjp, jvp, hvp: {found:?}");
    assert!(
        found.iter().all(|d| *d <= limit),
        "{what}: {found:?} past {limit:.0e}"
    );
}

fn at(x: [f64; 3]) -> Pose {
    Pose::new(Mat3::identity(), Vec3::from(x))
}

#[test]
fn bodies_among_walls_and_a_free_surface() {
    let bodies = three();
    for walls in [&[][..], &[WALL, FREE]] {
        let [cpu, gpu] = both(context(), 1e-12, |s| of(&bodies, walls, s));
        holds("three bodies", [&cpu, &gpu], &poses(), 5, 1e-9);
    }
}

/// Value and gradient; the tangents' kernels are held in two-float numbers one by one, for a software driver takes a minute to
/// compile them for other columns again.
#[test]
fn without_double_precision() {
    let shapes = [Shape::sphere(0.5), Shape::cuboid([0.9, 0.5, 0.6])];
    let bodies = shapes.map(|s| panels(&s, 20));
    let pair = both(two_float(), 1e-11, |s| of(&bodies, &[WALL], s));
    let (x, y) = (
        DVector::from_vec(wavy(5, 0.7)),
        DVector::from_vec(wavy(5, 1.9)),
    );
    let [cpu, gpu] = pair.each_ref().map(|c| {
        let record = c.linearise(&poses()[..2], &basis(2, 5, 0.3)).unwrap();
        let wrenches = flat(&record.gradient(&x, &y).unwrap());
        [record.momenta().as_slice().to_vec(), wrenches]
    });
    let found = [0, 1].map(|k| difference(&gpu[k], &cpu[k]));
    println!("two-float: value, gradient: {found:?}");
    assert!(found.iter().all(|d| *d <= 1e-10), "{found:?}");
}

#[test]
fn bodies_that_feel_images_alone_and_known_added_mass() {
    let bodies = three();
    let [cpu, gpu] = both(context(), 1e-12, |settings| {
        let excluded = Exclusions::new([(0, 1), (1, 2)]);
        let coupled = PanelCoupled::new(bodies.clone(), &[WALL], excluded, settings).unwrap();
        coupled.with_added_mass(&[Some(Mat6::identity()), None, None])
    });
    holds("exclusions", [&cpu, &gpu], &poses(), 3, 1e-9);
}

#[test]
fn more_columns_than_one_pass_takes() {
    let bodies = [
        panels(&Shape::sphere(0.5), 20),
        panels(&Shape::sphere(0.4), 80),
    ];
    let [cpu, gpu] = both(context(), 1e-12, |s| of(&bodies, &[], s));
    holds("13 columns", [&cpu, &gpu], &poses()[..2], 13, 1e-9);
}

/// The mass along a gap and its slope, with all rungs.
fn narrow(what: &str, bodies: &[Arc<PanelBoundary>], walls: &[Wall], poses: &[Pose], limit: f64) {
    let [cpu, gpu] = both(context(), 1e-12, |s| of(bodies, walls, s));
    holds(what, [&cpu, &gpu], poses, 2, limit);
}

#[test]
fn a_disc_flat_over_a_wall() {
    let disc = [panels(&Shape::cylinder(1.0, 0.25), 200)];
    for gap in [0.5, 0.1, 0.025] {
        let pose = [at([0.0, 0.0, gap + 0.125])];
        narrow(&format!("disc at {gap}"), &disc, &[FLOOR], &pose, 1e-8);
    }
}

#[test]
fn flat_and_round_gaps_between_bodies() {
    let cuboid = panels(&Shape::cuboid([1.0, 1.0, 0.5]), 200);
    let poses = [at([0.0; 3]), at([0.1, 0.05, 0.5 + 0.05])];
    narrow("box on box", &[cuboid.clone(), cuboid], &[], &poses, 1e-8);
    let ball = panels(&Shape::sphere(1.0), 180);
    let poses = [at([0.0; 3]), at([0.0, 0.3, 2.05])];
    narrow(
        "two spheres",
        &[ball.clone(), ball.clone()],
        &[],
        &poses,
        1e-8,
    );
    let surface = Wall {
        surface: WallSurface::Free,
        ..FLOOR
    };
    narrow(
        "sphere by a free surface",
        &[ball],
        &[surface],
        &[at([0.0, 0.0, 1.1])],
        1e-8,
    );
}

#[test]
fn two_meshes_are_extrapolated() {
    let at_faces = |faces| [Shape::sphere(0.5), Shape::sphere(0.4)].map(|s| panels(&s, faces));
    let (fine, coarse) = (at_faces(80), at_faces(20));
    let make = |context: Option<&Arc<Context>>| {
        let of = |bodies: &[Arc<PanelBoundary>]| {
            let made = of(bodies, &[WALL], tight(1e-12));
            context.map_or_else(|| of(bodies, &[WALL], tight(1e-13)), |c| on(c, made))
        };
        ExtrapolatedPanels::new(of(&fine), of(&coarse), 2.0).unwrap()
    };
    let (cpu, gpu) = (make(None), make(Some(context())));
    holds("extrapolated", [&cpu, &gpu], &poses()[..2], 3, 1e-9);
}

/// An answer meets the tolerance asked for, or says what was reached.
pub fn solves() {
    let bodies = three();
    let basis = basis(3, 3, 0.3);
    let rows: usize = bodies.iter().map(|b| b.faces.len()).sum();
    let panels = format!("({rows} panels)");
    let evaluate = |settings: SolveSettings| {
        on(context(), of(&bodies, &[WALL], settings)).evaluate(&poses(), &basis)
    };
    let exact = of(&bodies, &[WALL], tight(1e-13))
        .evaluate(&poses(), &basis)
        .unwrap();
    for tolerance in [1e-3, 1e-8, 1e-12] {
        let found = evaluate(tight(tolerance)).unwrap();
        let report = found.report();
        let error = difference(found.momenta().as_slice(), exact.momenta().as_slice());
        println!("{tolerance:.0e}: {report:?}, error {error:.1e}");
        assert!(
            report.residual <= tolerance && report.iterations > 1,
            "{report:?}"
        );
        assert!(error <= 10.0 * tolerance, "{error:e}");
    }
    // Tolerances that no arithmetic reaches, and too few iterations.
    let few = SolveSettings {
        max_iterations: 2,
        ..tight(1e-8)
    };
    for (settings, limit) in [(tight(1e-18), 1e-10), (few, 1.0)] {
        match evaluate(settings) {
            Err(Error::Solver {
                residual,
                tolerance,
                what,
                ..
            }) => {
                assert!(residual > tolerance && residual < limit, "{residual:e}");
                assert!(what.contains(&panels), "{what}");
                assert!(what.contains(&context().adapter().name), "{what}");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let gpu = on(context(), of(&three(), &[WALL], tight(1e-10)));
    let run = || {
        let record = gpu.linearise(&poses(), &basis(3, 3, 0.3)).unwrap();
        let x = DVector::from_vec(wavy(3, 0.7));
        (
            record.momenta().clone(),
            flat(&record.gradient(&x, &x).unwrap()),
        )
    };
    assert_eq!(run(), run());
}

#[test]
fn bodies_inside_each_other_or_behind_a_wall_are_the_cpus_errors() {
    let bodies = [
        panels(&Shape::sphere(0.5), 80),
        panels(&Shape::sphere(0.3), 20),
    ];
    let gap = at([0.0, 0.0, 0.9]);
    for (second, walls) in [
        (at([0.0, 0.2, 1.2]), &[][..]),
        (at([0.0, 0.0, 0.2]), &[FLOOR]),
        (
            at([0.0, 0.0, 0.4]),
            &[Wall {
                surface: WallSurface::Free,
                ..FLOOR
            }],
        ),
    ] {
        let [cpu, gpu] = both(context(), 1e-8, |s| of(&bodies, walls, s));
        let error = |c: &PanelCoupled| {
            let found = c.evaluate(&[gap, second], &DMatrix::identity(12, 12));
            found.expect_err("an error").to_string()
        };
        let found = error(&gpu);
        println!("{found}");
        assert_eq!(found, error(&cpu));
    }
}

#[test]
fn a_solver_that_needs_the_matrix_is_refused() {
    let settings = SolveSettings {
        solver: FullSolver::Qr,
        ..SolveSettings::default()
    };
    let coupled = of(&three(), &[], settings);
    let refused = GpuPanels::new(context(), coupled.model()).err();
    let message = refused.expect("refused").to_string();
    for word in ["Qr", "gmres", "backend cpu"] {
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn inverses_that_one_buffer_does_not_hold_are_an_error_with_the_bytes() {
    let most = context().adapter().largest_binding;
    let one = panels(&Shape::cuboid([1.0, 0.8, 0.6]), 2000);
    let bytes = 4 * (one.faces.len() as u64).pow(2);
    let count = most / bytes + 1;
    if count > 9 {
        println!("not tried: {most} bytes would take more panels than one system has");
        return;
    }
    // Shapes of their own, though all are alike.
    let bodies: Vec<_> = (0..count).map(|_| Arc::new((*one).clone())).collect();
    let coupled = of(&bodies, &[], SolveSettings::default());
    let message = match GpuPanels::new(context(), coupled.model()) {
        Err(error @ Error::Device { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|_| ())),
    };
    println!("{message}");
    for part in [
        &(count * bytes).to_string(),
        &most.to_string(),
        "backend cpu",
    ] {
        assert!(message.contains(part), "{message}");
    }
}

/// Every pair of a panel and (the image of) a centroid: K is A, P is S.
fn entries(model: &PanelModel, poses: &[Pose], z: &[Vec6], each: &mut dyn FnMut(Entry)) {
    for (t, target) in model.bodies.iter().enumerate() {
        let (pose, faces) = (&poses[t], &target.faces);
        let n = faces.len();
        let vertices: Vec<Vec3> = faces.corners.iter().flatten().copied().collect();
        let numbers: Vec<[usize; 3]> = (0..n).map(|i| [0, 1, 2].map(|c| 3 * i + c)).collect();
        let triangles = Triangles::new(&vertices, &numbers, vec![0.25 / PI; n]);
        for (number, image) in model.images.iter().enumerate() {
            for (c, source) in model.bodies.iter().enumerate() {
                if number == 0 && model.excluded.contains(t, c) {
                    continue;
                }
                let own = number == 0 && t == c;
                let (linear_part, shift) = image.placement(&poses[c]);
                let motion = image.twist(&z[c]) - z[t];
                let world = source.faces.centres.iter();
                let world: Vec<Vec3> = world.map(|s| linear_part * s + shift).collect();
                let moved = |at: &Vec3| linear(&motion) + angular(&motion).cross(at);
                let d: Vec<Vec3> = world.iter().map(moved).collect();
                let seen: Vec<Vec3> = world.iter().map(|s| pose.apply_inverse(s)).collect();
                let ds: Vec<Vec3> = d.iter().map(|d| pose.rotation.tr_mul(d)).collect();
                let (m, points) = (seen.len(), Sources::new(&seen));
                // One column a panel: `[point][panel]`, with three components of vectors.
                let mut unit = vec![0.0; n * n];
                (0..n).for_each(|i| unit[i * n + i] = image.sign);
                let mut k = vec![0.0; n * m];
                let mut p = vec![0.0; m * n];
                let mut slopes = vec![vec![0.0; 3 * m * n]; 4];
                if own {
                    flux_fill(&triangles, &points, Write::Set, &mut k, m, 0);
                    (0..n).for_each(|i| k[i * m + i] = 0.5);
                } else {
                    double_fill(&triangles, &points, Write::Set, &mut k, m, 0);
                    k.iter_mut().for_each(|k| *k *= image.sign);
                    single_sum(&triangles, &points, &unit, n, &mut p);
                    double_vjp(&triangles, &points, &unit, n, &mut slopes[0]);
                    double_hvp(&triangles, &points, &ds, &unit, n, &mut slopes[1]);
                    single_vjp(&triangles, &points, &unit, n, &mut slopes[2]);
                    single_hvp(&triangles, &points, &ds, &unit, n, &mut slopes[3]);
                }
                for j in 0..m {
                    for i in 0..n {
                        let [a, b, c2, e] = [0, 1, 2, 3].map(|which: usize| {
                            let v = &slopes[which][3 * (j * n + i)..][..3];
                            pose.rotation * Vec3::from_column_slice(v)
                        });
                        each(Entry {
                            target: t,
                            source: c,
                            image: number,
                            face: model.faces[t].start + i,
                            column: model.faces[c].start + j,
                            at: world[j],
                            d: d[j],
                            k: (k[i * m + j], a, b),
                            p: (p[j * n + i], c2, e),
                        });
                    }
                }
            }
        }
    }
}

/// Each arithmetic with the kernels that have it, and its limit; bodies near, far and in between, with an image of the opposite sign.
fn each_arithmetic(model: &Arc<PanelModel>, mut check: impl FnMut(Kernels, Arithmetic, f64)) {
    let gpu = GpuPanels::new(context(), model).unwrap();
    let probe = Probe::new(&gpu, &spread()).unwrap();
    for (arithmetic, limit) in LIMITS {
        if arithmetic == Arithmetic::Single || context().fine() == arithmetic {
            check(probe.kernels(), arithmetic, limit);
        }
    }
    let gpu = GpuPanels::new(two_float(), model).unwrap();
    let probe = Probe::new(&gpu, &spread()).unwrap();
    check(probe.kernels(), Arithmetic::TwoFloat, TWO);
}

/// Poses at all distances in panels: a small body seen by itself and by a large one.
fn spread() -> Vec<Pose> {
    let mut out = poses();
    out[2].translation = Vec3::new(0.6, 1.0, 1.1);
    out
}

fn kernel_model() -> Arc<PanelModel> {
    let cuboid = panels(&Shape::cuboid([0.9, 0.5, 0.6]), 100);
    let bodies = [
        panels(&Shape::sphere(0.5), 80),
        cuboid,
        panels(&Shape::sphere(0.3), 20),
    ];
    of(&bodies, &[WALL, FREE], SolveSettings::default())
        .model()
        .clone()
}

#[test]
fn products_with_layers_and_their_tangents() {
    let model = kernel_model();
    let z = displacement(model.bodies.len(), 0.9);
    let (mut near, mut blended, mut far) = (0, 0, 0);
    let right = Products::new(model.rows(), model.rows(), |each| {
        entries(&model, &spread(), &z, &mut |e: Entry| {
            let faces = &model.bodies[e.target].faces;
            let i = e.face - model.faces[e.target].start;
            let corners = faces.corners[i]
                .iter()
                .map(|v| (v - faces.centres[i]).norm());
            let seen = spread()[e.target].apply_inverse(&e.at) - faces.centres[i];
            match seen.norm() / corners.fold(0.0, f64::max) {
                ratio if ratio < 5.0 => near += 1,
                ratio if ratio < 7.0 => blended += 1,
                _ => far += 1,
            }
            each(e);
        });
    });
    println!("{near} pairs near, {blended} blended, {far} far");
    assert!([near, blended, far].iter().all(|n| *n > 1000));
    each_arithmetic(&model, |kernels, a, limit| {
        let length = kernels.units().0;
        right.hold(kernels, a, limit, [1.0, length], &z);
    });
}

/// Wrenches and their tangents of two columns.
pub fn derivatives() {
    let model = kernel_model();
    let (n, rows) = (2, model.rows());
    let (left, right) = (columns(rows, 3 * n, 2.2), columns(rows, 2 * n, 3.1));
    let z = displacement(model.bodies.len(), 0.2);
    let (images, bodies) = (model.images.len(), model.bodies.len());
    let mut sums = vec![vec![[Vec6::zeros(); 2]; n * n]; bodies * images * bodies];
    entries(&model, &spread(), &z, &mut |e: Entry| {
        if e.target == e.source && e.image == 0 {
            return;
        }
        let pair = &mut sums[(e.target * images + e.image) * bodies + e.source];
        for x in 0..n {
            let l = |block: usize| left.at(e.face, block * n + x);
            for y in 0..n {
                let r = |block: usize| right.at(e.column, block * n + y);
                let field = l(1) * e.p.1 - l(0) * e.k.1;
                let rate = l(1) * e.p.2 - l(0) * e.k.2 - l(2) * e.k.1;
                let (f, df) = (field * r(0), rate * r(0) + field * r(1));
                let sum = &mut pair[x * n + y];
                sum[0] += six(&f, &e.at.cross(&f));
                sum[1] += six(&df, &(e.d.cross(&f) + e.at.cross(&df)));
            }
        }
    });
    each_arithmetic(&model, |kernels, a, limit| {
        let (length, middle) = kernels.units();
        let spatial = |w: &[f64]| {
            let force = Vec3::new(w[0], w[1], w[2]);
            let moment = Vec3::new(w[3], w[4], w[5]) * length;
            six(&force, &(moment + middle.cross(&force)))
        };
        // Of A in units of S over the length.
        let scaled = |c: usize, x: f64| if c / n == 1 { x } else { x / length };
        let of = |from: &Columns, count: usize, left: bool| {
            let value = |i, c| match left {
                true => scaled(c, from.at(i, c)),
                false => from.at(i, c),
            };
            Columns::from_fn(rows, count, value)
        };
        for (motions, numbers) in [(None, 1), (Some(&z[..]), 2)] {
            let (l, r) = (
                of(&left, (1 + numbers) * n, true),
                of(&right, numbers * n, false),
            );
            let (pairs, values) = kernels.wrenches(a, motions, (&l, &r)).unwrap();
            let got: Vec<Vec6> = values.chunks(6).map(spatial).collect();
            for part in 0..numbers {
                let right = pairs.iter().flat_map(|[target, source, image]| {
                    let sum = &sums[(target * images + image) * bodies + source];
                    sum.iter().map(|s| s[part]).collect::<Vec<_>>()
                });
                let got: Vec<Vec6> = got.iter().skip(part).step_by(numbers).copied().collect();
                let name = ["panel_vjp", "panel_hvp"][part];
                close(
                    name,
                    a,
                    &flat(&got),
                    &flat(&right.collect::<Vec<_>>()),
                    limit,
                );
            }
        }
    });
}
