//! The coupled system on the device against the CPU's: value, vjp, jvp and hvp.

use super::fixture::*;
use hydrograd::adjoint::lie::Pose;
use hydrograd::boundary::Method;
use hydrograd::coupling::full::{Full, Model, Preconditioner, SolveSettings};
use hydrograd::coupling::{Direction, Exclusions, Linearise, Linearised};
use hydrograd::gpu::Context;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Largest difference of each rung: value, gradient, along, vjp, momenta of the tangent, tangent.
fn differences(context: &Arc<Context>, model: &Arc<Model>, columns: usize) -> [f64; 6] {
    let (cpu, gpu) = both(context, model);
    let n = model.bodies.len();
    rungs([&cpu, &gpu], &poses()[..n], &basis(n, columns, 0.3))
}

/// The same of two couplings.
pub fn rungs([cpu, gpu]: [&dyn Linearise; 2], poses: &[Pose], basis: &DMatrix<f64>) -> [f64; 6] {
    let (n, columns) = (poses.len(), basis.ncols());
    let a = cpu.linearise(poses, basis).unwrap();
    let b = gpu.linearise(poses, basis).unwrap();
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
    let along = difference(
        b.gradient_along(&y, &z).unwrap().as_slice(),
        a.gradient_along(&y, &z).unwrap().as_slice(),
    );
    let pull = |r: &dyn Linearised| {
        let p = r
            .vjp(Direction::Basis(&x), Direction::Twist(&free))
            .unwrap();
        [
            p.momentum_x.as_slice(),
            p.momentum_y.as_slice(),
            &flat(&p.wrench),
        ]
        .concat()
    };
    let vjp = difference(&pull(&*b), &pull(&*a));
    let second = |r: &dyn Linearised, same: bool| {
        let right = if same {
            Direction::Basis(&x)
        } else {
            Direction::Twist(&free)
        };
        let t = r.hvp(Direction::Basis(&x), right, &z).unwrap();
        let momenta = [t.momentum_x.as_slice(), t.momentum_y.as_slice()].concat();
        (momenta, [flat(&t.gradient), flat(&t.wrench)].concat())
    };
    let (mut jvp, mut hvp) = (0.0_f64, 0.0_f64);
    for same in [true, false] {
        let (a, b) = (second(&*a, same), second(&*b, same));
        jvp = jvp.max(difference(&b.0, &a.0));
        hvp = hvp.max(difference(&b.1, &a.1));
    }
    [value, gradient, along, vjp, jvp, hvp]
}

fn holds(context: &Arc<Context>, model: &Arc<Model>, columns: usize, limit: f64) {
    let found = differences(context, model, columns);
    println!("value, gradient, along, vjp, jvp, hvp: {found:?}");
    assert!(
        found.iter().all(|d| *d <= limit),
        "{found:?} past {limit:.0e}"
    );
}

#[test]
fn flux_rows_without_walls() {
    let model = model(
        Method::MfsVertex,
        &[],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    holds(context(), &model, 5, 1e-8);
}

#[test]
fn flux_rows_with_two_walls() {
    let model = model(
        Method::MfsVertex,
        &[WALL, SIDE],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    holds(context(), &model, 5, 1e-8);
}

#[test]
fn normal_rows_with_an_excluded_pair_and_a_wall() {
    let model = model(
        Method::MfsFace,
        &[WALL],
        Exclusions::new([(0, 1)]),
        tight(Preconditioner::Factors),
    );
    holds(context(), &model, 5, 1e-8);
}

#[test]
fn without_double_precision() {
    let settings = SolveSettings {
        tolerance: 1e-9,
        ..tight(Preconditioner::Factors)
    };
    let model = model(Method::MfsVertex, &[WALL], Exclusions::none(), settings);
    holds(two_float(), &model, 5, 1e-7);
}

#[test]
fn without_factors() {
    let settings = SolveSettings {
        tolerance: 1e-9,
        ..tight(Preconditioner::Jacobi)
    };
    holds(context(), &small(&[], settings), 5, 1e-6);
}

#[test]
fn more_columns_than_one_pass_takes() {
    let model = model(
        Method::MfsVertex,
        &[],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    holds(context(), &model, 13, 1e-8);
}

#[test]
fn a_displacement_of_any_size_gives_a_tangent_of_that_size() {
    let model = model(
        Method::MfsVertex,
        &[],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    let (_, gpu) = both(two_float(), &model);
    let n = model.bodies.len();
    let record = gpu.linearise(&poses(), &basis(n, 5, 0.3)).unwrap();
    let x = DVector::from_vec(wavy(5, 0.7));
    let along = |size: f64| {
        let z: Vec<_> = (displacement(n, 2.3).iter()).map(|z| z * size).collect();
        let t = record
            .hvp(Direction::Basis(&x), Direction::Basis(&x), &z)
            .unwrap();
        let numbers = [t.momentum_x.as_slice(), &flat(&t.wrench)].concat();
        numbers.iter().map(|v| v / size).collect::<Vec<_>>()
    };
    for size in [1e-25, 1e25] {
        let found = difference(&along(size), &along(1.0));
        assert!(found <= 1e-9, "{size:e}: {found:.1e}");
    }
}

/// Energies and momenta of columns, and of combinations of them.
pub fn combinations() {
    let model = model(
        Method::MfsVertex,
        &[],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    for context in [context(), two_float()] {
        let (cpu, gpu) = both(context, &model);
        let n = model.bodies.len();
        let basis = basis(n, 5, 0.3);
        let (x, y) = (
            DVector::from_vec(wavy(5, 0.7)),
            DVector::from_vec(wavy(5, 1.9)),
        );
        let of = |full: &Full| {
            let response = full.backend().respond(&poses(), &basis).unwrap();
            let some = response
                .directions(&[Direction::Basis(&x), Direction::Basis(&y)])
                .unwrap();
            let numbers = [
                response.energies().unwrap(),
                response.momenta().unwrap(),
                some.energies().unwrap(),
                some.momenta().unwrap(),
            ];
            let strengths = [response.densities().unwrap(), some.densities().unwrap()];
            numbers
                .iter()
                .map(|m| m.as_slice().to_vec())
                .chain(strengths.into_iter().map(|s| s.data))
                .collect::<Vec<_>>()
        };
        for (got, right) in of(&gpu).iter().zip(of(&cpu)) {
            let found = difference(got, &right);
            println!("combinations: {found:.1e}");
            assert!(found <= 1e-8, "{found:.1e}");
        }
    }
}
