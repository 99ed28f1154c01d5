//! Compressed bodies on the device against the CPU's: value, vjp, jvp and hvp.

use super::fixture::*;
use hydrograd::Error;
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::boundary::{BodyBoundary, MfsSettings};
use hydrograd::coupling::reduced::{Cutoff, Reduced, ReducedBody, compress};
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise, Linearised};
use hydrograd::gpu::reduced::GpuReduced;
use hydrograd::gpu::{Context, Options};
use hydrograd::scene::{Shape, Wall, WallSurface};
use hydrograd::shape;
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use std::sync::{Arc, OnceLock};

fn compressed(shape: &Shape, rank: usize) -> Arc<ReducedBody> {
    let mesh = shape::build(shape, Path::new("."), Some(320)).unwrap();
    let b = BodyBoundary::new("b", &mesh, &MfsSettings::default()).unwrap();
    let settings = compress::CompressSettings {
        rank: Some(rank),
        ..compress::CompressSettings::default()
    };
    Arc::new(compress::compress("b", &mesh, &b, &settings, &[]).unwrap())
}

/// Two shapes, one of more points than a block.
fn shapes() -> &'static [Arc<ReducedBody>; 2] {
    static SHAPES: OnceLock<[Arc<ReducedBody>; 2]> = OnceLock::new();
    SHAPES.get_or_init(|| {
        [
            compressed(&Shape::sphere(0.4), 20),
            compressed(&Shape::ellipsoid([0.5, 0.3, 0.4]), 70),
        ]
    })
}

/// Three bodies, two of one shape.
pub fn three(walls: &[Wall], cutoff: Option<Cutoff>, excluded: &Exclusions) -> Arc<Reduced> {
    let [ball, egg] = shapes().clone();
    let bodies = vec![ball.clone(), egg, ball];
    let reduced = Reduced::new(bodies, walls, |_, _| cutoff).unwrap();
    Arc::new(reduced.excluding(excluded).unwrap())
}

fn pull(r: &dyn Linearised, x: Direction, y: Direction) -> Vec<f64> {
    let p = r.vjp(x, y).unwrap();
    [
        p.momentum_x.as_slice(),
        p.momentum_y.as_slice(),
        &flat(&p.wrench),
    ]
    .concat()
}

/// Largest difference of each rung: value, gradient, columns, along, vjp, momenta of the tangent, tangent.
fn differences(gpu: &GpuReduced, poses: &[Pose], columns: usize) -> [f64; 7] {
    let (n, reduced) = (poses.len(), gpu.reduced());
    let basis = basis(n, columns, 0.3);
    let a = reduced.linearise(poses, &basis).unwrap();
    let b = gpu.linearise(poses, &basis).unwrap();
    println!("cpu {:?}\ngpu {:?}", a.report(), b.report());
    let x = DVector::from_vec(wavy(columns, 0.7));
    let y = DVector::from_vec(wavy(columns, 1.9));
    let z = displacement(n, 2.3);
    let free = twist(n, 4.1);
    let value = difference(b.momenta().as_slice(), a.momenta().as_slice());
    let gradient = difference(
        &flat(&b.gradient(&x, &y).unwrap()),
        &flat(&a.gradient(&x, &y).unwrap()),
    );
    let each = |r: &dyn Linearised| flat(&r.gradient_columns(&x).unwrap().concat());
    let each = difference(&each(&*b), &each(&*a));
    let along = difference(
        b.gradient_along(&y, &z).unwrap().as_slice(),
        a.gradient_along(&y, &z).unwrap().as_slice(),
    );
    let (on, off) = (Direction::Basis(&x), Direction::Twist(&free));
    let vjp = difference(&pull(&*b, on, off), &pull(&*a, on, off));
    let second = |r: &dyn Linearised, right: Direction| {
        let t = r.hvp(on, right, &z).unwrap();
        let momenta = [t.momentum_x.as_slice(), t.momentum_y.as_slice()].concat();
        (momenta, flat(&t.gradient), flat(&t.wrench))
    };
    let (mut jvp, mut hvp) = (0.0_f64, 0.0_f64);
    for right in [on, off] {
        let (a, b) = (second(&*a, right), second(&*b, right));
        jvp = jvp.max(difference(&b.0, &a.0));
        hvp = hvp.max(difference(&b.1, &a.1)).max(difference(&b.2, &a.2));
    }
    [value, gradient, each, along, vjp, jvp, hvp]
}

fn holds(
    context: &Arc<Context>,
    reduced: &Arc<Reduced>,
    poses: &[Pose],
    columns: usize,
    limit: f64,
) {
    let gpu = GpuReduced::new(context, reduced.clone()).unwrap();
    let found = differences(&gpu, poses, columns);
    println!("value, gradient, columns, along, vjp, jvp, hvp: {found:?}");
    assert!(
        found.iter().all(|d| *d <= limit),
        "{found:?} past {limit:.0e}"
    );
}

/// In both fine arithmetics.
pub fn rungs() {
    let reduced = three(&[WALL], None, &Exclusions::none());
    holds(context(), &reduced, &poses(), 5, 1e-8);
    holds(two_float(), &reduced, &poses(), 5, 1e-7);
}

#[test]
fn reduced_in_both_arithmetics() {
    rungs();
}

#[test]
fn reduced_between_walls_and_under_a_free_surface() {
    let free = Wall {
        surface: WallSurface::Free,
        ..SIDE
    };
    for walls in [[WALL, SIDE], [WALL, free]] {
        let reduced = three(&walls, None, &Exclusions::none());
        holds(context(), &reduced, &poses(), 5, 1e-8);
    }
}

#[test]
fn reduced_without_the_flow_between_some() {
    let excluded = Exclusions::new([(0, 2)]);
    for walls in [&[][..], &[WALL]] {
        let reduced = three(walls, None, &excluded);
        holds(context(), &reduced, &poses(), 5, 1e-8);
    }
}

#[test]
fn reduced_where_pairs_fade_out() {
    let cutoff = Some(Cutoff {
        near: 0.8,
        far: 2.9,
    });
    let reduced = three(&[WALL], cutoff, &Exclusions::none());
    holds(context(), &reduced, &poses(), 5, 1e-8);
}

/// A loose grid of bodies.
fn many(count: usize) -> (Arc<Reduced>, Vec<Pose>) {
    let [ball, egg] = shapes().clone();
    let bodies: Vec<_> = (0..count)
        .map(|b| {
            if b % 3 == 1 {
                egg.clone()
            } else {
                ball.clone()
            }
        })
        .collect();
    let turns = displacement(count, 5.5);
    let poses = (0..count)
        .map(|b| {
            let place = Vec3::new((b % 4) as f64, (b / 4 % 4) as f64, (b / 16) as f64);
            Pose::new(
                exp_matrix(&turns[b].fixed_rows::<3>(0).into_owned()),
                1.4 * place,
            )
        })
        .collect();
    let reduced = Reduced::new(bodies, &[], |_, _| None).unwrap();
    (Arc::new(reduced), poses)
}

#[test]
fn reduced_of_64_bodies() {
    let (reduced, poses) = many(64);
    let gpu = GpuReduced::new(context(), reduced.clone()).unwrap();
    let basis = basis(64, 5, 0.3);
    let a = reduced.linearise(&poses, &basis).unwrap();
    let b = gpu.linearise(&poses, &basis).unwrap();
    println!("cpu {:?}\ngpu {:?}", a.report(), b.report());
    let x = DVector::from_vec(wavy(5, 0.7));
    let y = DVector::from_vec(wavy(5, 1.9));
    let value = difference(b.momenta().as_slice(), a.momenta().as_slice());
    let (x, y) = (Direction::Basis(&x), Direction::Basis(&y));
    let vjp = difference(&pull(&*b, x, y), &pull(&*a, x, y));
    println!("value, vjp of 64 bodies: {value:.1e} {vjp:.1e}");
    assert!(value <= 1e-8 && vjp <= 1e-8);
}

/// More columns than the derivatives of all pairs are kept of.
#[test]
fn reduced_with_many_columns() {
    let reduced = three(&[], None, &Exclusions::none());
    holds(context(), &reduced, &poses(), 30, 1e-8);
}

#[test]
fn reduced_gives_the_same_bits_again() {
    let reduced = three(&[WALL], None, &Exclusions::none());
    let gpu = GpuReduced::new(context(), reduced).unwrap();
    let basis = basis(3, 5, 0.3);
    let x = DVector::from_vec(wavy(5, 0.7));
    let once = || {
        let r = gpu.linearise(&poses(), &basis).unwrap();
        let on = Direction::Basis(&x);
        let t = r.hvp(on, on, &displacement(3, 2.3)).unwrap();
        [
            r.momenta().as_slice(),
            &flat(&r.gradient(&x, &x).unwrap()),
            &flat(&t.wrench),
        ]
        .concat()
    };
    assert_eq!(once(), once());
}

#[test]
fn bodies_in_one_another_are_refused_as_by_the_cpu() {
    let reduced = three(&[], None, &Exclusions::none());
    let mut poses = poses();
    poses[1].translation = poses[0].translation + Vec3::new(0.35, 0.0, 0.0);
    let gpu = GpuReduced::new(context(), reduced.clone()).unwrap();
    // Whatever is asked: a body that is far from the others.
    for basis in [
        basis(3, 5, 0.3),
        DMatrix::from_fn(18, 1, |i, _| f64::from(u8::from(i == 12))),
    ] {
        let of = |c: &dyn Coupling| match c.evaluate(&poses, &basis).err() {
            Some(Error::Unresolved {
                place,
                quantity,
                value,
                limit,
                ..
            }) => (place, quantity, value, limit),
            other => panic!("{other:?}"),
        };
        let (cpu, gpu) = (of(&*reduced), of(&gpu));
        println!("{cpu:?}\n{gpu:?}");
        assert!(cpu.1.contains("smallest eigenvalue"), "{cpu:?}");
        assert_eq!((&cpu.0, &cpu.1, cpu.3), (&gpu.0, &gpu.1, gpu.3));
        assert!(gpu.2 <= 0.0);
    }
}

/// So close that the host has to look again.
#[test]
fn reduced_close_to_one_another() {
    let reduced = three(&[], None, &Exclusions::none());
    let gpu = GpuReduced::new(context(), reduced.clone()).unwrap();
    let gpu = gpu.within(1e-13).unwrap();
    let mut poses = poses();
    poses[1].translation = Vec3::new(0.0, 4.0, 0.0);
    poses[2].translation = poses[0].translation + Vec3::new(0.7, 0.0, 0.0);
    let found = differences(&gpu, &poses, 5);
    println!("value, gradient, columns, along, vjp, jvp, hvp: {found:?}");
    assert!(found.iter().all(|d| *d <= 1e-8), "{found:?}");
    let report = gpu.evaluate(&poses, &basis(3, 5, 0.3)).unwrap();
    assert!(report.report().iterations > 16, "{:?}", report.report());
}

#[test]
fn tolerances_out_of_range_are_refused() {
    for tolerance in [0.0, 1e-15, 1.0, f64::NAN] {
        let reduced = three(&[], None, &Exclusions::none());
        let gpu = GpuReduced::new(context(), reduced).unwrap();
        assert!(gpu.within(tolerance).is_err(), "{tolerance}");
    }
}

#[test]
fn reduced_without_columns_or_neighbours() {
    let reduced = Arc::new(Reduced::new(vec![shapes()[0].clone()], &[], |_, _| None).unwrap());
    holds(context(), &reduced, &poses()[..1], 5, 1e-8);
    let gpu = GpuReduced::new(context(), reduced).unwrap();
    let none = gpu.linearise(&poses()[..1], &DMatrix::zeros(6, 0));
    assert_eq!(none.unwrap().momenta().shape(), (6, 0));
}

#[test]
fn reduced_on_a_lost_device_is_an_error() {
    let own = Context::new(&Options::default()).unwrap();
    let gpu = GpuReduced::new(&own, three(&[], None, &Exclusions::none())).unwrap();
    let basis = basis(3, 30, 0.3);
    let record = gpu.linearise(&poses(), &basis).unwrap();
    own.lose();
    let x = DVector::from_vec(wavy(30, 0.7));
    let z = displacement(3, 2.3);
    let on = Direction::Basis(&x);
    let failed = [
        record.gradient(&x, &x).err(),
        record.gradient_columns(&x).err(),
        record.gradient_along(&x, &z).err(),
        record.vjp(on, on).err(),
        record.hvp(on, on, &z).err(),
        gpu.linearise(&poses(), &basis).err(),
    ];
    for e in failed {
        assert!(matches!(e, Some(Error::Device { .. })), "{e:?}");
    }
}
