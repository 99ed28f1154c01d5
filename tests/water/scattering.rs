//! Many bodies by products alone: against the factor, conserved momenta, gradients, joints, and what is refused.

use crate::support::{mesh, says};
use hydrograd::adjoint::lie::{Mat6, Pose, Vec3, Vec6, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::boundary::ExactBoundary;
use hydrograd::coupling::reduced::{Reduced, ReducedBody, compress};
use hydrograd::coupling::scattering::{Apart, Goal, Levels, Motions, Own, Scattering};
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise};
use hydrograd::dynamics::Integrator;
use hydrograd::geometry::Image;
use hydrograd::scene::{Body, Fluid, Joint, Motion, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::Exchange;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The error of what must not succeed.
fn refusal<T>(made: hydrograd::Result<T>) -> String {
    made.err()
        .map_or("nothing was refused".into(), |e| e.to_string())
}

/// Bodies that recoil alone.
fn recoiling<'r>(
    scale: &'r DVector<f64>,
    recoil: &'r dyn Fn(&DVector<f64>) -> DVector<f64>,
) -> Own<'r> {
    Own {
        scale,
        recoil,
        films: false,
    }
}

/// A round and a flat body of largest radius 1, compressed for gaps of about a tenth.
fn kinds(tolerance: f64) -> [Arc<ReducedBody>; 2] {
    [[1.0; 3], [1.0, 0.4, 0.7]].map(|axes| {
        let mesh = mesh(&Shape::ellipsoid(axes), 320);
        let response = ExactBoundary::new("body", axes, &Pose::identity(), 0.3).unwrap();
        let settings = compress::CompressSettings {
            rank: None,
            tolerance,
            resolved_gap: Some(0.3),
        };
        Arc::new(compress::compress("body", &mesh, &response, &settings, &[]).unwrap())
    })
}

/// A thin plate and a cylinder of largest radius about 1, of more than sixty points each.
fn edged(accuracy: f64) -> [Arc<ReducedBody>; 2] {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (k, shape) in [Shape::cuboid([1.4, 1.2, 0.2]), Shape::cylinder(0.6, 1.4)]
        .into_iter()
        .enumerate()
    {
        let body = Body::new(shape.faces(320)).density(2000.0);
        scene.add(body.at([3.0 * k as f64, 0.0, 0.0]));
    }
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(Exchange::Products)
        .accuracy(accuracy);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let many = simulator.system().coupling.scattering().unwrap();
    [0, 1].map(|b| many.reduced_bodies()[b].clone())
}

/// Bodies of both kinds on a grid with gaps of about `gap`, moved and turned at random.
fn grid(drawn: &mut Samples, count: usize, gap: f64) -> Vec<Pose> {
    let side = (count as f64).cbrt().ceil() as usize;
    let at = |k: usize| {
        Vec3::new(
            (k % side) as f64,
            (k / side % side) as f64,
            (k / side / side) as f64,
        )
    };
    let one = |k: usize| {
        let place = (2.0 + gap) * at(k) + 0.15 * gap * Vec3::from(drawn.vector(1.0));
        Pose::new(exp_matrix(&Vec3::from(drawn.vector(3.0))), place)
    };
    (0..count).map(one).collect()
}

fn both(kinds: &[Arc<ReducedBody>; 2], poses: &[Pose], accuracy: f64) -> (Reduced, Scattering) {
    let bodies: Vec<_> = (0..poses.len()).map(|b| kinds[b % 2].clone()).collect();
    let factor = Reduced::new(bodies, &[], |_, _| None).unwrap();
    let levels = Levels::for_accuracy(accuracy).unwrap();
    let products = Scattering::of(&factor, poses, levels).unwrap();
    (factor, products)
}

/// Largest entry of the difference of two columns of impulses, relative to each body's own.
fn error(kinds: &[Arc<ReducedBody>; 2], found: &DMatrix<f64>, right: &DMatrix<f64>) -> f64 {
    let scale = |i: usize| {
        let parts = kinds[i / 6 % 2].parts();
        let own = parts.added_mass[(i % 6, i % 6)];
        own.max(0.01 * parts.volume).sqrt()
    };
    let mut worst = 0.0_f64;
    for (i, (a, b)) in found.row_iter().zip(right.row_iter()).enumerate() {
        worst = worst.max((a - b).amax() / scale(i));
    }
    worst
}

#[test]
fn products_meet_the_factor_to_the_accuracy_asked_for() {
    for (accuracy, edges) in [
        (0.03, false),
        (0.01, false),
        (1e-3, false),
        (0.03, true),
        (0.01, true),
    ] {
        let kinds = match edges {
            true => edged(accuracy),
            false => kinds(accuracy),
        };
        let mut worst = 0.0_f64;
        for seed in 0..6 {
            let mut drawn = Samples::new(seed);
            let gap = [1.0, 0.5, 0.3][seed as usize % 3];
            let poses = grid(&mut drawn, 27, gap);
            let (factor, products) = both(&kinds, &poses, accuracy);
            // Unit motions of single bodies: columns of M_f.
            let basis = DMatrix::from_fn(6 * 27, 3, |i, k| {
                let unit = [0, 6 * 13 + 2, 6 * 20 + 4][k];
                f64::from(i == unit)
            });
            let columns = |coupling: &dyn Coupling| {
                coupling.evaluate(&poses, &basis).unwrap().momenta().clone()
            };
            let scaled = |mut m: DMatrix<f64>| {
                for (mut column, i) in m.column_iter_mut().zip([0, 6 * 13 + 2, 6 * 20 + 4]) {
                    let parts = kinds[i / 6 % 2].parts();
                    let own = parts.added_mass[(i % 6, i % 6)].max(0.01 * parts.volume);
                    column /= own.sqrt();
                }
                m
            };
            let (found, right) = (scaled(columns(&products)), scaled(columns(&factor)));
            worst = worst.max(error(&kinds, &found, &right));
        }
        let points = kinds[0].points() + kinds[1].points();
        println!(
            "accuracy {accuracy:.0e}, {points} points of two: error {worst:.1e} of the added mass"
        );
        assert!(worst < 0.5 * accuracy, "accuracy {accuracy}: {worst:e}");
        assert!(worst > 1e-12, "nothing was left out at all");
    }
}

/// Bodies whose coefficients are their twists.
struct Free;

impl Motions for Free {
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        coefficients.clone()
    }

    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64> {
        impulses.clone()
    }
}

#[test]
fn what_is_known_changes_no_answer_and_coarse_solves_add_up() {
    let kinds = kinds(0.01);
    let mut drawn = Samples::new(23);
    let poses = grid(&mut drawn, 27, 0.2);
    let (_, many) = both(&kinds, &poses, 0.01);
    let mut random = || DVector::from_fn(6 * 27, |_, _| 0.5 * drawn.number());
    let [x, y, z] = [random(), random(), random()];
    let alone = |twists: &DVector<f64>| {
        let at = many.place(&poses, Box::new(Free)).unwrap();
        let found = at.respond(twists);
        at.check().unwrap();
        (found.exchanged.clone(), found.charges.clone())
    };
    let at = many.place(&poses, Box::new(Free)).unwrap();
    at.respond(&x);
    at.respond(&y);
    let whole = at.report().iterations;
    // In their span, near it, and far from it.
    for (near, part) in [(true, 0.0), (true, 1e-12), (true, 1e-4), (false, 1.0)] {
        let twists = 0.3 * &x - 7.0 * &y + part * &z;
        let (found, right) = (at.respond(&twists), alone(&twists));
        let error = (&found.exchanged - &right.0).norm() / right.0.norm();
        let pairs = found.charges.iter().zip(&right.1);
        let charges = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let charges = charges / right.1.iter().map(|a| a * a).sum::<f64>().sqrt();
        println!("{near} {part:e}: impulses {error:.1e}, charges {charges:.1e}");
        assert!(error < 1e-9 && charges < 1e-9);
    }
    at.check().unwrap();
    assert!(at.report().iterations <= whole + 1);

    // One after the other, each nearly the last: what sums of sums leave doesn't grow.
    let mut worst = 0.0_f64;
    let mut twists = x.clone();
    for _ in 0..30 {
        twists += 2e-3 * random();
        let (found, right) = (at.respond(&twists), alone(&twists));
        let error = (&found.exchanged - &right.0).norm() / right.0.norm();
        worst = worst.max(error);
    }
    at.check().unwrap();
    println!("thirty, each nearly the last: {worst:.1e}");
    assert!(worst < 1e-9);

    // Bodies of the water's density that are given momenta.
    let own = many.own().to_vec();
    let inertia = |i: usize| 1.0 + own[i / 6][(i % 6, i % 6)];
    let scale = DVector::from_fn(6 * 27, |i, _| inertia(i).sqrt());
    let recoil = |h: &DVector<f64>| DVector::from_fn(h.len(), |i, _| h[i] / inertia(i));
    let solve = |first: &DVector<f64>, behind: Option<&[f64]>, goal: Goal| {
        let found = at.recoil(first, behind, &recoiling(&scale, &recoil), goal);
        (first - recoil(&found.exchanged), found.left)
    };
    let (right, _) = solve(&x, None, Goal::Full);
    let (mut sum, mut left) = solve(&x, None, Goal::Relative(1e-2));
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let first = norm(&left);
    let none = DVector::zeros(6 * 27);
    for _ in 0..5 {
        let (more, after) = solve(&none, Some(&left), Goal::Relative(1e-2));
        sum += more;
        left = after;
    }
    let error = (&sum - &right).norm() / right.norm();
    println!(
        "six coarse solves: {error:.1e}, {:.1e} left of {first:.1e}",
        norm(&left)
    );
    assert!(norm(&left) < 1e-8 * first && error < 1e-9);
    at.check().unwrap();
}

/// Bodies seen point by point at any distance: products differ from the factor by what solves leave.
fn pointwise(factor: &Reduced, poses: &[Pose]) -> Scattering {
    let never = Apart {
        sure: 1e-9,
        most: 2e-9,
    };
    let levels = Levels {
        bodies: never,
        cells: never,
        ..Levels::for_accuracy(0.01).unwrap()
    };
    Scattering::of(factor, poses, levels).unwrap()
}

/// Impulses that the others add to each body's own, by the factor.
fn exchanged(factor: &Reduced, poses: &[Pose], twists: &DVector<f64>) -> DVector<f64> {
    let basis = DMatrix::from_columns(std::slice::from_ref(twists));
    let found = factor.evaluate(poses, &basis).unwrap();
    let mut out = found.momenta().column(0).into_owned();
    for (b, body) in factor.reduced_bodies().iter().enumerate() {
        let own = body.parts().added_mass * twists.fixed_rows::<6>(6 * b);
        let mut rows = out.fixed_rows_mut::<6>(6 * b);
        rows -= own;
    }
    out
}

/// Largest relative difference of a body's own part.
fn worst_of(found: &DVector<f64>, right: &DVector<f64>, of: impl Iterator<Item = usize>) -> f64 {
    let part = |x: &DVector<f64>, b: usize| x.fixed_rows::<6>(6 * b).norm();
    let off = found - right;
    of.map(|b| part(&off, b) / part(right, b))
        .fold(0.0, f64::max)
}

/// A body that is given no added mass, or hardly any, moves the water as its shape does: an answer to other motions of it isn't taken for this one's.
#[test]
fn what_is_given_hides_no_motion() {
    let kinds = kinds(0.01);
    for left in [0.0, 1e-15] {
        let mut drawn = Samples::new(31);
        let poses = grid(&mut drawn, 8, 0.3);
        let (factor, _) = both(&kinds, &poses, 0.01);
        let mut many = pointwise(&factor, &poses);
        let mut change = vec![Mat6::zeros(); 8];
        change[3] = (left - 1.0) * kinds[1].parts().added_mass;
        assert!(many.give(&change));
        let mut twists = DVector::from_fn(48, |_, _| 0.5 * drawn.number());
        let at = many.place(&poses, Box::new(Free)).unwrap();
        at.respond(&twists);
        let mut worst = 0.0_f64;
        for _ in 0..2 {
            for k in 0..6 {
                twists[18 + k] = 0.5 * drawn.number();
            }
            let right = exchanged(&factor, &poses, &twists);
            worst = worst.max(worst_of(&at.respond(&twists).exchanged, &right, 0..8));
        }
        at.check().unwrap();
        println!("{left:e} of its added mass left: impulses differ by {worst:.1e}");
        assert!(worst < 1e-8, "{worst}");
    }
}

/// What a large body does hides nothing of what small ones do, however much more water it moves; nor do they of what it does.
#[test]
fn small_bodies_beside_a_large_one_are_as_exact() {
    let kinds = kinds(0.01);
    for size in [1.0, 30.0, 300.0, 3e4] {
        let mut drawn = Samples::new(37);
        let mut poses = grid(&mut drawn, 8, 0.3);
        let far = Vec3::new(0.0, 0.0, -1.6 * size - 3.0);
        poses.push(Pose::new(exp_matrix(&Vec3::zeros()), far));
        let mut bodies: Vec<_> = (0..8).map(|b| kinds[b % 2].clone()).collect();
        bodies.push(Arc::new(kinds[1].scaled(size).unwrap()));
        let factor = Reduced::new(bodies, &[], |_, _| None).unwrap();
        let many = pointwise(&factor, &poses);
        // Surfaces are about as fast, or one of the two is ten thousand times as slow.
        for speeds in [[1.0, 1.0], [1.0, 1e-4], [1e-4, 1.0]] {
            let mut random = || {
                DVector::from_fn(54, |i, _| {
                    let [small, large] = speeds;
                    let speed = if i < 48 { small } else { large };
                    let arm = if i >= 51 { size } else { 1.0 };
                    0.5 * speed / arm * drawn.number()
                })
            };
            let first = random();
            let at = many.place(&poses, Box::new(Free)).unwrap();
            at.respond(&first);
            let mut worst = 0.0_f64;
            let mut twists = first.clone();
            for part in [0.3, 1e-3, 1e-5] {
                let mut more = part * random();
                more.rows_mut(48, 6).fill(0.0);
                twists += more;
                let right = exchanged(&factor, &poses, &twists);
                // Of the large one the factor's has its own in it, a rounding of which is more than what others add.
                worst = worst.max(worst_of(&at.respond(&twists).exchanged, &right, 0..8));
            }
            at.check().unwrap();
            let known = at.report().iterations;

            // Bodies of the water's density that are given momenta.
            let at = many.place(&poses, Box::new(Free)).unwrap();
            let own = many.own().to_vec();
            let inertia = |i: usize| {
                let arm = if i >= 48 { size } else { 1.0 };
                own[i / 6][(i % 6, i % 6)] + arm.powi(if i % 6 < 3 { 3 } else { 5 })
            };
            let scale = DVector::from_fn(54, |i, _| inertia(i).sqrt());
            let recoil = |h: &DVector<f64>| DVector::from_fn(54, |i, _| h[i] / inertia(i));
            let columns: Vec<_> = (0..54)
                .map(|i| {
                    let unit = DVector::from_fn(54, |k, _| f64::from(i == k));
                    &unit + recoil(&exchanged(&factor, &poses, &unit))
                })
                .collect();
            let dense = DMatrix::from_columns(&columns).lu();
            let right = dense.solve(&first).unwrap();
            let found = at.recoil(&first, None, &recoiling(&scale, &recoil), Goal::Full);
            let found = &first - recoil(&found.exchanged);
            let turned = |x: &DVector<f64>| {
                DVector::from_fn(54, |i, _| x[i] * if i >= 51 { size } else { 1.0 })
            };
            let freed = worst_of(&turned(&found), &turned(&right), 0..9);
            at.check().unwrap();
            println!(
                "one {size} times as large, speeds {speeds:?}: impulses of a body differ by {worst:.1e} in {known} iterations, velocities by {freed:.1e} in {}",
                at.report().iterations
            );
            assert!(
                worst < 1e-9 && freed < 1e-9,
                "{size} {speeds:?}: {worst} {freed}"
            );
        }
    }
}

#[test]
fn wrenches_add_up_to_nothing_and_are_slopes_of_the_energy() {
    slopes_of_the_energy(&kinds(0.01), 0.4);
    slopes_of_the_energy(&edged(0.01), 0.6);
}

fn slopes_of_the_energy(kinds: &[Arc<ReducedBody>; 2], gap: f64) {
    let mut drawn = Samples::new(5);
    let poses = grid(&mut drawn, 27, gap);
    let (_, products) = both(kinds, &poses, 0.01);
    let twists = DVector::from_fn(6 * 27, |_, _| 0.5 * drawn.number());
    let basis = DMatrix::from_columns(std::slice::from_ref(&twists));
    let one = DVector::from_element(1, 1.0);
    let at = products.linearise(&poses, &basis).unwrap();
    let wrenches = at.gradient(&one, &one).unwrap();
    let total: Vec6 = wrenches.iter().sum();
    let largest = wrenches.iter().map(Vec6::amax).fold(0.0, f64::max);
    println!("total wrench {:.1e} of the largest", total.amax() / largest);
    // Torques are about the world's origin: arms of twelve radii.
    assert!(total.amax() < 1e-12 * largest);
    let z: Vec<Vec6> = (0..27)
        .map(|_| Vec6::from_fn(|_, _| 0.5 * drawn.number()))
        .collect();
    let energy = |h: f64| {
        let moved: Vec<Pose> = poses
            .iter()
            .zip(&z)
            .map(|(p, z)| p.displace(&(h * z)))
            .collect();
        twists.dot(
            &products
                .evaluate(&moved, &basis)
                .unwrap()
                .momenta()
                .column(0),
        )
    };
    let h = 1e-3;
    let slope = (8.0 * (energy(h) - energy(-h)) - energy(2.0 * h) + energy(-2.0 * h)) / (12.0 * h);
    let found: f64 = wrenches.iter().zip(&z).map(|(w, z)| w.dot(z)).sum();
    println!("slope {found:.9e}, by differences {slope:.9e}");
    assert!((found - slope).abs() < 1e-7 * slope.abs());
    // The rate of the wrenches, by differences of them.
    let tangent = at
        .hvp(Direction::Twist(&twists), Direction::Twist(&twists), &z)
        .unwrap();
    let along = |h: f64| -> Vec<Vec6> {
        let moved: Vec<Pose> = poses
            .iter()
            .zip(&z)
            .map(|(p, z)| p.displace(&(h * z)))
            .collect();
        products
            .linearise(&moved, &basis)
            .unwrap()
            .gradient(&one, &one)
            .unwrap()
    };
    let sides = [along(h), along(-h), along(2.0 * h), along(-2.0 * h)];
    let size = tangent.wrench.iter().map(Vec6::amax).fold(0.0, f64::max);
    for (b, found) in tangent.wrench.iter().enumerate() {
        let by = (8.0 * (sides[0][b] - sides[1][b]) - sides[2][b] + sides[3][b]) / (12.0 * h);
        assert!((found - by).amax() < 1e-6 * size, "body {b}: {found} {by}");
    }
    // Of two directions they are linear in each, however small it is.
    let other = DVector::from_fn(6 * 27, |_, _| 0.5 * drawn.number());
    let (slopes, whole) = both_of(at.as_ref(), &twists, &other, &z);
    for scale in [1e-12, 1e9] {
        let (part, rate) = both_of(at.as_ref(), &twists, &(scale * &other), &z);
        for (all, some) in [(&slopes, &part), (&whole.wrench, &rate.wrench)] {
            let size = all.iter().map(Vec6::amax).fold(0.0, f64::max);
            let off = all.iter().zip(some).map(|(a, b)| (a - b / scale).amax());
            assert!(off.fold(0.0, f64::max) < 1e-9 * size, "{scale:.0e}");
        }
        let size = whole.momentum_y.amax();
        let off = (&whole.momentum_y - &rate.momentum_y / scale).amax();
        assert!(off < 1e-9 * size, "{scale:.0e}: {:.1e}", off / size);
    }
}

/// Slopes of the energy of two twists, and their tangent.
fn both_of(
    at: &dyn hydrograd::coupling::Linearised,
    x: &DVector<f64>,
    y: &DVector<f64>,
    z: &[Vec6],
) -> (Vec<Vec6>, hydrograd::coupling::Tangent) {
    let of = |x| Direction::Twist(x);
    let pulled = at.vjp(of(x), of(y)).unwrap();
    (pulled.wrench, at.hvp(of(x), of(y), z).unwrap())
}

/// Spheres and ellipsoids, free, moving at random.
fn swarm(count: usize, gap: f64, density: f64) -> Scene {
    let shapes = [Shape::sphere(0.1), Shape::ellipsoid([0.1, 0.05, 0.08])];
    swarm_of(&shapes, count, gap, density)
}

/// The same of these shapes in turn.
fn swarm_of(shapes: &[Shape; 2], count: usize, gap: f64, density: f64) -> Scene {
    let mut drawn = Samples::new(11);
    let mut scene = Scene::new(Fluid::fresh_water());
    let mut v = Vec::new();
    for (k, pose) in grid(&mut drawn, count, gap).iter().enumerate() {
        let shape = &shapes[k % 2];
        let place = 0.1 * pose.translation;
        scene.add(
            Body::new(shape.clone().faces(320))
                .density(density)
                .at([place.x, place.y, place.z]),
        );
        v.extend((0..6).map(|_| 0.2 * drawn.number()));
    }
    scene.initial.v = v;
    scene
}

fn settings(exchange: Exchange, integrator: Integrator) -> Settings {
    Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(exchange)
        .integrator(integrator)
        .accuracy(0.01)
        .films(false)
        .time_step(0.01)
}

#[test]
fn rollouts_agree_keep_momentum_and_have_gradients() {
    rollouts_agree(&swarm(12, 0.6, 1300.0));
    // Bodies with edges.
    let shapes = [
        Shape::cuboid([0.14, 0.12, 0.05]),
        Shape::cylinder(0.06, 0.14),
    ];
    rollouts_agree(&swarm_of(&shapes, 12, 0.7, 1300.0));
}

fn rollouts_agree(scene: &Scene) {
    let steps = 4;
    let run = |exchange| {
        let simulator = Simulator::new(scene, settings(exchange, Integrator::Rk2)).unwrap();
        let controls = Controls::zeros(&simulator, steps);
        simulator.rollout(&controls).unwrap()
    };
    let (products, factor) = (run(Exchange::Products), run(Exchange::Factor));
    let [first, last] = [0, steps].map(|k| products.samples()[k].clone());
    let kept = (last.momentum - first.momentum).amax() / first.largest_momentum.amax();
    println!("momentum kept to {kept:.1e} of the largest");
    assert!(kept < 1e-12);
    let change = |r: &hydrograd::Rollout| &r.samples()[steps].v - &r.samples()[0].v;
    let (found, right) = (change(&products), change(&factor));
    let error = (&found - &right).norm() / right.norm();
    println!("accelerations differ by {error:.1e} of their norm");
    assert!(error < 0.01);

    // Gradients with respect to where and how fast bodies start, against differences along random directions.
    let mut drawn = Samples::new(3);
    let simulator = products.simulator();
    let weights = DVector::from_fn(found.len(), |_, _| 0.5 * drawn.number());
    let loss = |q: &DVector<f64>, v: &DVector<f64>| {
        let state = simulator.state(0, q, v).unwrap();
        let controls = Controls::zeros(simulator, steps);
        let rollout = simulator
            .rollout_from(&state, &controls, |_| std::ops::ControlFlow::Continue(()))
            .unwrap();
        weights.dot(&rollout.samples()[steps].v)
    };
    let start = products.samples()[0].clone();
    // w (v − t)² with the target half a unit below the end has the slope w there.
    let target = |i: usize| objective::final_velocity(i, last.v[i] - 0.5, weights[i]);
    let loss_at_end = (1..weights.len()).fold(target(0), |sum, i| sum + target(i));
    let gradient = products.gradient(&loss_at_end).unwrap();
    let h = 1e-4;
    let mut worst = 0.0_f64;
    for _ in 0..50 {
        let dv = DVector::from_fn(start.v.len(), |_, _| 0.5 * drawn.number());
        let by = (8.0
            * (loss(&start.q, &(&start.v + h * &dv)) - loss(&start.q, &(&start.v - h * &dv)))
            - loss(&start.q, &(&start.v + 2.0 * h * &dv))
            + loss(&start.q, &(&start.v - 2.0 * h * &dv)))
            / (12.0 * h);
        let found = gradient.initial.v.dot(&dv);
        worst = worst.max((found - by).abs() / by.abs().max(0.1 * gradient.initial.v.norm()));
    }
    println!("gradients agree with differences to {worst:.1e}");
    assert!(worst < 1e-6);
}

/// Neutrally buoyant cubes that don't turn, whose own motion makes no force: as with spheres, accelerations are all coupling.
#[test]
fn accelerations_of_cubes_are_as_exact_as_asked_for() {
    let (side, half) = (0.12, 0.06 * 3.0_f64.sqrt());
    let mut drawn = Samples::new(2);
    let mut scene = Scene::new(Fluid::fresh_water());
    for pose in grid(&mut drawn, 27, 1.0) {
        let place = half * pose.translation;
        let cube = Body::new(Shape::cuboid([side; 3]).faces(320)).density(scene.fluid.density);
        let mut cube = cube.at([place.x, place.y, place.z]);
        cube.placement.rotation = drawn.vector(3.0);
        scene.add(cube);
        let v = &mut scene.initial.v;
        v.extend((0..6).map(|i| if i < 3 { drawn.number() } else { 0.0 }));
    }
    for accuracy in [0.03, 0.01] {
        let change = |exchange| {
            let settings = settings(exchange, Integrator::Rk2).accuracy(accuracy);
            let simulator = Simulator::new(&scene, settings).unwrap();
            let rollout = simulator.rollout(&Controls::zeros(&simulator, 1)).unwrap();
            let [first, last] = [0, 1].map(|k| &rollout.samples()[k].v);
            // Turns by what they move of a cube's corner.
            let arm = |i: usize| if i % 6 < 3 { 1.0 } else { half };
            DVector::from_fn(last.len(), |i, _| arm(i) * (last[i] - first[i]))
        };
        let [found, right] = [Exchange::Products, Exchange::Factor].map(change);
        let error = (&found - &right).norm() / right.norm();
        println!("accuracy {accuracy}: accelerations of cubes differ by {error:.1e}");
        assert!(error < accuracy, "{error:e}");
    }
}

/// Between a bed and a free surface that are near: the same columns, and wrenches that are slopes of the energy.
#[test]
fn walls_mirror_bodies_as_the_factor_does() {
    mirrored_as_by_the_factor(&kinds(0.01), 0.05);
    // Flatter bodies see less of walls at these places.
    mirrored_as_by_the_factor(&edged(0.01), 0.01);
}

fn mirrored_as_by_the_factor(kinds: &[Arc<ReducedBody>; 2], least: f64) {
    let mut drawn = Samples::new(7);
    let poses = grid(&mut drawn, 12, 0.5);
    // The grid's sides are 2.5 apart; bodies reach out by one, and a little is drawn.
    let bed = Wall {
        surface: WallSurface::Rigid,
        point: [0.0, 0.0, -1.6],
        normal: [0.0, 0.0, 1.0],
    };
    let surface = Wall {
        surface: WallSurface::Free,
        point: [0.0, 7.0, 0.0],
        normal: [0.0, -1.0, 0.0],
    };
    let walls = [bed, surface];
    let bodies: Vec<_> = (0..12).map(|b| kinds[b % 2].clone()).collect();
    let factor = Reduced::new(bodies.clone(), &walls, |_, _| None).unwrap();
    let names = (0..12).map(|b| format!("fish {b}")).collect();
    let images = Image::of_walls(&walls).unwrap();
    let levels = Levels::for_accuracy(0.01).unwrap();
    let products = Scattering::between(bodies, names, &poses, images, levels).unwrap();
    let twists = DMatrix::from_fn(72, 2, |_, _| 0.5 * drawn.number());
    let columns = |coupling: &dyn Coupling| {
        coupling
            .evaluate(&poses, &twists)
            .unwrap()
            .momenta()
            .clone()
    };
    let (found, right) = (columns(&products), columns(&factor));
    let open = Reduced::new(factor.reduced_bodies().to_vec(), &[], |_, _| None).unwrap();
    let (all, walls_make) = (
        error(kinds, &found, &right),
        error(kinds, &columns(&open), &right),
    );
    println!("columns differ by {all:.1e}, of which walls make {walls_make:.1e}");
    assert!(all < 0.005 && walls_make > least);

    let one = DVector::from_column_slice(&[1.0, 0.0]);
    let at = products.linearise(&poses, &twists).unwrap();
    let z: Vec<Vec6> = (0..12)
        .map(|_| Vec6::from_fn(|_, _| 0.5 * drawn.number()))
        .collect();
    let along = |h: f64| {
        let moved = poses.iter().zip(&z).map(|(p, z)| p.displace(&(h * z)));
        let moved: Vec<Pose> = moved.collect();
        let at = products.linearise(&moved, &twists).unwrap();
        let wrenches = at.gradient(&one, &one).unwrap();
        (twists.column(0).dot(&at.momenta().column(0)), wrenches)
    };
    let h = 1e-3;
    let [a, b, c, d] = [h, -h, 2.0 * h, -2.0 * h].map(along);
    let slope = (8.0 * (a.0 - b.0) - c.0 + d.0) / (12.0 * h);
    let told: f64 = (at.gradient(&one, &one).unwrap().iter().zip(&z))
        .map(|(w, z)| w.dot(z))
        .sum();
    println!("slope {told:.9e}, by differences {slope:.9e}");
    assert!((told - slope).abs() < 1e-7 * slope.abs());
    let x = twists.column(0).into_owned();
    let tangent = at
        .hvp(Direction::Twist(&x), Direction::Twist(&x), &z)
        .unwrap();
    let size = tangent.wrench.iter().map(Vec6::amax).fold(0.0, f64::max);
    for (k, found) in tangent.wrench.iter().enumerate() {
        let by = (8.0 * (a.1[k] - b.1[k]) - c.1[k] + d.1[k]) / (12.0 * h);
        assert!((found - by).amax() < 1e-6 * size, "body {k}: {found} {by}");
    }
}

/// Integrators that solve their stages: products as the factor, beside a wall and in a current, and gradients against differences.
#[test]
fn implicit_integrators_agree_and_have_gradients() {
    let mut scene = swarm(5, 0.5, 1300.0);
    scene.fluid.current = [0.1, 0.05, 0.0];
    scene.add_wall([0.0, 0.0, -0.17], [0.0, 0.0, 1.0]);
    let steps = 2;
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::EnergyEuler,
        Integrator::Midpoint,
        Integrator::VelocityEuler,
    ] {
        let [products, factor] = [Exchange::Products, Exchange::Factor].map(|exchange| {
            let simulator = Simulator::new(&scene, settings(exchange, integrator)).unwrap();
            let controls = Controls::zeros(&simulator, steps);
            simulator.rollout(&controls).unwrap()
        });
        let change = |r: &hydrograd::Rollout| &r.samples()[steps].v - &r.samples()[0].v;
        let (found, right) = (change(&products), change(&factor));
        let error = (&found - &right).norm() / right.norm();
        let last = &products.samples()[steps].v;
        let mut drawn = Samples::new(4);
        let weights = DVector::from_fn(last.len(), |_, _| 0.5 * drawn.number());
        let target = |i: usize| objective::final_velocity(i, last[i] - 0.5, weights[i]);
        let loss = (1..weights.len()).fold(target(0), |sum, i| sum + target(i));
        let gradient = products.gradient(&loss).unwrap().initial;
        let along = DVector::from_fn(last.len(), |_, _| 0.5 * drawn.number());
        let start = products.simulator();
        // Where and how fast they start at once.
        let value = |h: f64| {
            let mut moved = start.clone();
            let (q, v) = moved.start();
            let q = start.system().tree.integrate(q, &(0.01 * h * &along));
            let v = v + h * &along;
            moved.set_start(q, v).unwrap();
            let rollout = moved.rollout(&Controls::zeros(&moved, steps)).unwrap();
            weights.dot(&rollout.samples()[steps].v)
        };
        let told = (&gradient.v + 0.01 * &gradient.q).dot(&along);
        let h = 1e-3;
        let sides = |h: f64| value(h) - value(-h);
        let by = (8.0 * sides(h) - sides(2.0 * h)) / (12.0 * h);
        let worst = (told - by).abs() / by.abs();
        println!(
            "{integrator:?}: accelerations differ by {error:.1e}, gradients from differences by {worst:.1e}"
        );
        assert!(error < 0.01, "{integrator:?}: {error}");
        assert!(worst < 1e-6, "{integrator:?}: {worst}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    // So many that all sums are cut into parts.
    let mut scene = swarm(300, 0.5, 1100.0);
    scene.walls.push(Wall {
        surface: WallSurface::Rigid,
        point: [0.0, 0.0, -0.2],
        normal: [0.0, 0.0, 1.0],
    });
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let settings = settings(Exchange::Products, Integrator::Rk2);
            let simulator = Simulator::new(&scene, settings).unwrap();
            let controls = Controls::zeros(&simulator, 1);
            let rollout = simulator.rollout(&controls).unwrap();
            let gradient = rollout
                .gradient(&objective::final_velocity(0, 0.0, 1.0))
                .unwrap();
            (rollout.samples()[1].v.clone(), gradient.initial.q.clone())
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
}

#[test]
fn chains_with_driven_joints_and_excluded_pairs_agree() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for k in 0..3 {
        let at = [0.0, 0.35 * f64::from(k), 0.0];
        let link = || Body::new(Shape::ellipsoid([0.12, 0.04, 0.08]).faces(320)).density(1000.0);
        scene.add(link().named(format!("front {k}")).at(at));
        let joint = Joint::Revolute {
            axis: [0.0, 0.0, 1.0],
        };
        let mut tail = link()
            .named(format!("tail {k}"))
            .at([0.22, 0.0, 0.0])
            .joint(joint);
        tail.parent = Some(format!("front {k}"));
        tail = tail.overlaps_parent().actuated();
        scene.add(tail);
    }
    let run = |exchange| {
        let simulator = Simulator::new(&scene, settings(exchange, Integrator::Rk4)).unwrap();
        let controls = DMatrix::from_fn(3, 5, |i, _| [0.3, -0.2, 0.1][i]);
        let controls = Controls::from_matrix(&simulator, controls).unwrap();
        let rollout = simulator.rollout(&controls).unwrap();
        rollout.samples()[5].v.clone()
    };
    let (found, right) = (run(Exchange::Products), run(Exchange::Factor));
    let error = (&found - &right).norm() / right.norm();
    println!("velocities of driven chains differ by {error:.1e}");
    assert!(error < 1e-3);
}

/// Stages begin from the stage before: which is nothing at rest, and far more than what is asked for where all turn back at once.
#[test]
fn what_rests_and_what_turns_back_is_solved() {
    let still = |scene: &mut Scene| scene.initial.v.iter_mut().for_each(|v| *v = 0.0);
    for integrator in [Integrator::Rk2, Integrator::Rk4] {
        let mut scene = swarm(8, 0.6, 1100.0);
        still(&mut scene);
        let simulator = Simulator::new(&scene, settings(Exchange::Products, integrator)).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
        assert!(rollout.v().iter().all(|v| *v == 0.0));
        let gradient = rollout.gradient(&objective::final_velocity(0, -0.5, 1.0));
        let slope = gradient.unwrap().initial.v[0];
        assert!((slope - 1.0).abs() < 1e-9, "{slope}");
        // A quarter of the period is a step: the last stage of RK4 is where all velocities vanish.
        let mut scene = swarm(8, 0.6, 1100.0);
        still(&mut scene);
        for body in &mut scene.bodies {
            body.joint = Joint::Prismatic {
                axis: [0.0, 0.0, 1.0],
            };
            body.motion = Some(vec![Motion::Sine {
                amplitude: 0.005,
                frequency: 50.0 * std::f64::consts::PI,
                phase: 0.0,
                offset: 0.0,
            }]);
        }
        scene.initial.v.clear();
        let simulator = Simulator::new(&scene, settings(Exchange::Products, integrator)).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 4)).unwrap();
        let most = rollout.samples()[1].v.amax();
        assert!(most < 1e-12, "{most}");
    }
}

#[test]
fn what_isnt_there_is_refused_by_name() {
    let poses = vec![Pose::identity()];
    let kinds = kinds(0.03);
    let levels = Levels::for_accuracy(0.01).unwrap();
    let one = || vec![kinds[0].clone()];
    says(
        refusal(Scattering::new(one(), Vec::new(), &poses, levels)),
        &["names", "1"],
    );
    let bad = Pose::new(poses[0].rotation, Vec3::new(f64::NAN, 0.0, 0.0));
    let named = vec!["shoal".to_string()];
    says(
        refusal(Scattering::new(one(), named, &[bad], levels)),
        &["shoal", "finite"],
    );
    says(refusal(Levels::for_accuracy(0.0)), &["accuracy", "0.01"]);
    let pair = both(&kinds, &grid(&mut Samples::new(1), 2, 1.0), 0.01).1;
    says(
        refusal(pair.excluding(&Exclusions::new([(0, 7)]))),
        &["(0, 7)"],
    );
}

/// From a factor come its bodies' names, of which those of equal shape have one in what they are compressed to.
#[test]
fn a_factors_names_are_kept() {
    let (kinds, surface) = (kinds(0.03), mesh(&Shape::sphere(1.0), 320));
    let factor = Reduced::new(vec![kinds[0].clone(); 2], &[], |_, _| None).unwrap();
    let factor = factor
        .named(["pike", "perch"].map(String::from))
        .with_films(&[(&surface, None), (&surface, None)], &[0.03; 2], &[])
        .unwrap();
    assert_eq!(factor.names(), ["pike", "perch"]);
    let beside = |x: f64| {
        let first = Pose::identity();
        [first, Pose::new(first.rotation, Vec3::new(x, 0.0, 0.0))]
    };
    let levels = Levels::for_accuracy(0.01).unwrap();
    let many = Scattering::of(&factor, &beside(3.0), levels).unwrap();
    let basis = DMatrix::from_element(12, 1, 1.0);
    says(
        refusal(many.evaluate(&beside(1.5), &basis)),
        &["pike", "perch"],
    );
}

#[test]
fn bodies_in_one_another_are_an_error_not_a_number() {
    let kinds = kinds(0.03);
    let (_, products) = both(&kinds, &grid(&mut Samples::new(2), 8, 0.5), 0.01);
    let mut poses = grid(&mut Samples::new(2), 8, 0.5);
    poses[3] = Pose::new(
        poses[4].rotation,
        poses[4].translation + Vec3::new(0.05, 0.0, 0.0),
    );
    let basis = DMatrix::from_fn(48, 1, |i, _| f64::from(i % 6 == 0));
    match products.evaluate(&poses, &basis) {
        Err(error) => {
            let told = error.to_string();
            assert!(
                told.contains("nearer than") && told.contains("body"),
                "{told}"
            );
        }
        Ok(found) => assert!(found.momenta().iter().all(|x| x.is_finite())),
    }
}

/// Where points don't resolve a gap, I − LᵀGL has no positive energy and the factor says so. A search finds something there as well: what has less than no energy, and a search
/// whose directions show it, is refused by the names of the nearest.
#[test]
fn what_has_no_energy_is_refused() {
    let kinds = edged(0.03);
    let (mut refused, mut told) = (0, 0);
    for seed in 0..12 {
        let mut drawn = Samples::new(seed);
        let turn = Pose::new(
            exp_matrix(&Vec3::new(0.0, 0.0, drawn.number())),
            Vec3::zeros(),
        );
        // A plate flat over another.
        let apart = 0.2 + 1e-3 * 2.0_f64.powi(seed as i32 % 6);
        let mut poses = vec![turn; 4];
        poses[2].translation.z = apart;
        for (k, x) in [(1, -3.0), (3, 3.0)] {
            poses[k].translation.x = x;
        }
        let (factor, products) = both(&kinds, &poses, 0.01);
        let basis = DMatrix::identity(24, 24);
        if factor.evaluate(&poses, &basis).is_ok() {
            continue;
        }
        refused += 1;
        match products.evaluate(&poses, &basis) {
            Ok(found) => {
                let least = found.momenta().diagonal().min();
                assert!(least > -1e-2, "{apart}: {least}");
            }
            Err(error) => {
                told += 1;
                says(error.to_string(), &["0", "nearer than", "films"]);
            }
        }
    }
    println!("of {refused} that the factor refuses {told} are refused by products");
    assert!(refused > 0 && told == refused, "{told} of {refused}");
}
