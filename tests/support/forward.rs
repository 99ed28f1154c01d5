//! Forward mode held against the reverse sweep.

use hydrograd::adjoint::sample::Samples;
use hydrograd::simulate::{Cotangents, Displacement};
use hydrograd::{Controls, Rollout, Simulator};
use nalgebra::{DMatrix, DVector};

/// Largest accepted difference between both modes: rounding, and in stages that the reverse iterates what that leaves.
pub const LIMIT: f64 = 1e-10;

/// Observables with derivatives, beside q and v.
pub const OBSERVED: [&str; 4] = ["positions", "rotations", "velocities", "angular_momentum"];

/// A random displacement of everything: parameters and gains by parts of their values.
pub fn displacement(rollout: &Rollout, seed: u64) -> Displacement {
    let mut random = Samples::new(seed);
    let mut out = rollout.zero_displacement();
    let mut fill = |x: &mut [f64], size: f64| {
        x.iter_mut().for_each(|x| *x = size * random.number());
    };
    fill(out.controls.as_mut_slice(), 1.0);
    fill(out.initial.q.as_mut_slice(), 0.1);
    fill(out.initial.v.as_mut_slice(), 0.3);
    let mut scaled = |values: &[f64]| -> Vec<f64> {
        let each = values.iter();
        each.map(|x| (0.1 * x.abs()).max(1e-3) * random.number())
            .collect()
    };
    let values = rollout.simulator().parameters().to_vec();
    let parameters = &out.parameters;
    out.parameters = parameters.with_values(&scaled(&values)).unwrap();
    out.gains = scaled(&rollout.simulator().policy().gains());
    out
}

fn cotangents(rollout: &Rollout, seed: u64) -> Cotangents {
    let mut random = Samples::new(seed);
    let mut fill =
        |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| random.number());
    let mut out = rollout.zero_cotangents();
    for part in [
        &mut out.q,
        &mut out.v,
        &mut out.positions,
        &mut out.rotations,
        &mut out.controls,
        &mut out.applied_controls,
    ] {
        *part = fill(part.nrows(), part.ncols());
    }
    for name in ["velocities", "angular_momentum"] {
        let rows = rollout.observe(name).unwrap().nrows();
        out.observables
            .insert(name.into(), fill(rows, rollout.steps() + 1));
    }
    out
}

/// ⟨w, J d⟩ and ⟨Jᵀ w, d⟩ for three directions at once, relative to the sum of what both add up.
pub fn gap(rollout: &Rollout) -> f64 {
    let along = [11, 12, 13].map(|seed| displacement(rollout, seed));
    let w = cotangents(rollout, 21);
    let back = rollout.vjp(&w).unwrap();
    let forth = rollout.jvp(&along, &OBSERVED).unwrap();
    let mut worst = 0.0_f64;
    for (d, t) in along.iter().zip(&forth) {
        let mut terms = vec![
            w.q.component_mul(&t.q),
            w.v.component_mul(&t.v),
            w.positions.component_mul(&t.observables["positions"]),
            w.rotations.component_mul(&t.observables["rotations"]),
            w.controls.component_mul(&d.controls),
            w.applied_controls.component_mul(&t.applied_controls),
        ];
        for (name, w) in &w.observables {
            terms.push(w.component_mul(&t.observables[name]));
        }
        let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
            terms.iter().flat_map(|m| m.iter()).map(|x| of(*x)).sum()
        };
        let row = |x: &[f64]| DVector::from_column_slice(x);
        let parts = [
            back.controls.component_mul(&d.controls).sum(),
            back.initial.q.dot(&d.initial.q),
            back.initial.v.dot(&d.initial.v),
            row(back.parameters.as_slice()).dot(&row(d.parameters.as_slice())),
            row(&back.gains).dot(&row(&d.gains)),
        ];
        let size = sum(&f64::abs) + parts.iter().map(|x| x.abs()).sum::<f64>();
        let product: f64 = parts.iter().sum();
        worst = worst.max((sum(&|x| x) - product).abs() / size);
    }
    worst
}

/// Both modes are one linear map along the scene's own trajectory.
#[track_caller]
pub fn check_forward(what: &str, simulator: &Simulator, steps: usize, limit: f64) {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    let found = gap(&rollout);
    println!("{what}: forward against reverse {found:.1e}");
    assert!(
        found <= limit,
        "{what}: forward and reverse differ by {found:e}"
    );
}
