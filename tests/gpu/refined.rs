//! What a refined solve reaches, and what it says where it can't.

use super::fixture::*;
use hydrograd::Error;
use hydrograd::boundary::Method;
use hydrograd::coupling::full::{FullSolver, Preconditioner};
use hydrograd::coupling::{Coupling, Exclusions, Linearise};
use hydrograd::gpu::Arithmetic;
use hydrograd::gpu::full::{Gpu, Probe};
use hydrograd::solver::Columns;

#[test]
fn an_answer_meets_the_tolerance_asked_for() {
    let mut worst = 0.0_f64;
    let exact = {
        let model = model(
            Method::MfsVertex,
            &[],
            Exclusions::none(),
            tight(Preconditioner::Factors),
        );
        let (cpu, _) = both(context(), &model);
        cpu.evaluate(&poses(), &basis(3, 5, 0.3))
            .unwrap()
            .momenta()
            .clone()
    };
    for tolerance in [1e-3, 1e-6, 1e-8, 1e-12] {
        let mut settings = tight(Preconditioner::Factors);
        settings.tolerance = tolerance;
        let model = model(Method::MfsVertex, &[], Exclusions::none(), settings);
        let (_, gpu) = both(context(), &model);
        let record = gpu.evaluate(&poses(), &basis(3, 5, 0.3)).unwrap();
        let report = record.report();
        let error = difference(record.momenta().as_slice(), exact.as_slice());
        println!(
            "{tolerance:.0e}: {} iterations, residual {:.1e}, error {error:.1e}",
            report.iterations, report.residual
        );
        assert!(report.residual <= tolerance, "{report:?}");
        worst = worst.max(error / tolerance);
    }
    // The energy's error is of second order in the residual; the condition number takes some of it back.
    assert!(worst <= 10.0, "{worst}");
}

#[test]
fn what_cannot_be_reached_is_an_error_with_the_residual() {
    let mut settings = tight(Preconditioner::Factors);
    settings.tolerance = 1e-17;
    let model = model(Method::MfsVertex, &[], Exclusions::none(), settings);
    let (_, gpu) = both(context(), &model);
    match gpu.evaluate(&poses(), &basis(3, 5, 0.3)).err() {
        Some(Error::Solver {
            residual,
            tolerance,
            ..
        }) => {
            assert!(residual > tolerance && residual < 1e-9, "{residual:e}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn too_few_iterations_are_an_error() {
    let mut settings = tight(Preconditioner::None);
    settings.max_iterations = 5;
    let model = model(Method::MfsVertex, &[], Exclusions::none(), settings);
    let (_, gpu) = both(context(), &model);
    let error = gpu.evaluate(&poses(), &basis(3, 5, 0.3)).err();
    assert!(matches!(error, Some(Error::Solver { .. })), "{error:?}");
}

#[test]
fn solvers_that_need_a_matrix_are_refused() {
    let mut settings = tight(Preconditioner::Factors);
    settings.solver = FullSolver::Qr;
    let model = model(Method::MfsVertex, &[], Exclusions::none(), settings);
    let message = Gpu::new(context(), &model)
        .err()
        .expect("refused")
        .to_string();
    assert!(message.contains("cgls"), "{message}");
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let model = model(
        Method::MfsVertex,
        &[WALL],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    let (_, gpu) = both(context(), &model);
    let run = || {
        let record = gpu.linearise(&poses(), &basis(3, 5, 0.3)).unwrap();
        let x = nalgebra::DVector::from_vec(wavy(5, 0.7));
        let wrench = flat(&record.gradient(&x, &x).unwrap());
        (record.momenta().clone(), wrench)
    };
    assert_eq!(run(), run());
}

#[test]
fn what_is_too_large_for_a_buffer_is_an_error_with_the_bytes() {
    let model = model(
        Method::MfsVertex,
        &[],
        Exclusions::none(),
        tight(Preconditioner::Factors),
    );
    let gpu = Gpu::new(context(), &model).unwrap();
    let probe = Probe::new(&gpu, &poses()).unwrap();
    let most = context().adapter().largest_binding;
    if most > 1 << 30 {
        println!("not tried: {most} bytes would take the host's memory first");
        return;
    }
    let columns = (most / 4) as usize / model.columns() + 1;
    let x = Columns::zeros(model.columns(), columns);
    match probe
        .kernels()
        .product(Arithmetic::Single, (false, false), None, &x)
    {
        Err(error @ Error::Device { .. }) => {
            let message = error.to_string();
            assert!(message.contains(&most.to_string()), "{message}");
        }
        other => panic!("{:?}", other.map(|c| c.columns)),
    }
}
