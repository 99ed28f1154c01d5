//! The added mass: symmetric, positive, of a scale, and the bodies' whatever their order.

use crate::scenes::{FIDELITIES, drifting, few, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::{Fidelity, Scene};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn added_mass(scene: &Scene, fidelity: Fidelity) -> DMatrix<f64> {
    let simulator = simulator(scene, fidelity, Integrator::default());
    simulator.added_mass().unwrap().matrix
}

/// A length of the bodies, m: what makes rotations and translations of one unit.
const LENGTH: f64 = 0.05;

/// max |ΔM_ij| over the largest entry, at the speeds of surfaces.
fn off(found: &DMatrix<f64>, right: &DMatrix<f64>) -> f64 {
    let alike = |m: &DMatrix<f64>| {
        let power = |i: usize| LENGTH.powi(-((i / 3 % 2) as i32));
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * power(i) * power(j))
    };
    (alike(found) - alike(right)).amax() / alike(right).amax()
}

/// Scaled so that its diagonal is one.
fn scaled(m: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
        m[(i, j)] / (m[(i, i)] * m[(j, j)]).sqrt()
    })
}

proptest! {
    #![proptest_config(few(14))]

    /// Reciprocity holds to rounding: what is solved for is symmetrised. No motion of rigid bodies takes energy from water at rest.
    #[test]
    fn it_is_symmetric_and_positive(scene in drifting()) {
        for fidelity in FIDELITIES {
            let simulator = simulator(&scene, fidelity, Integrator::default());
            let added = simulator.added_mass().unwrap();
            let m = added.matrix;
            let difference = (&m - m.transpose()).amax();
            prop_assert!(difference <= 1e-14 * m.amax(), "{fidelity:?}: {difference:e}");
            for (b, body) in scene.bodies.iter().enumerate() {
                for k in 0..3 {
                    prop_assert!(m[(6 * b + k, 6 * b + k)] > 0.0, "{fidelity:?} {}", body.name);
                }
            }
            // With the bodies' own inertia, about their origins: what steps divide by.
            let (q, v) = simulator.start();
            let e = simulator.stepper().linearise(q, 0.0).unwrap();
            let n = v.len();
            let columns: Vec<_> = (0..n)
                .map(|k| {
                    let mut unit = v.clone();
                    unit.fill(0.0);
                    unit[k] = 1.0;
                    e.frame_momentum(&unit)
                })
                .collect();
            let mass = DMatrix::from_columns(&columns);
            let difference = (&mass - mass.transpose()).amax();
            prop_assert!(difference <= 1e-13 * mass.amax(), "{fidelity:?}: {difference:e}");
            let least = scaled(&mass).symmetric_eigenvalues().min();
            prop_assert!(least > 0.01, "{fidelity:?}: {least}");
        }
    }

    /// m³, m⁴ and m⁵ of the lengths, and the water's density; compressed bodies share one grid of lengths, so up to its rounding.
    #[test]
    fn it_scales_with_lengths_and_density(scene in drifting(), factor in 0.02..50.0_f64) {
        let mut larger = scene.clone();
        for body in &mut larger.bodies {
            body.placement.position = body.placement.position.map(|x| factor * x);
            let shape = body.shape.as_mut().unwrap();
            let toml = toml::to_string(shape).unwrap();
            let mut value: toml::Table = toml::from_str(&toml).unwrap();
            for (key, value) in value.iter_mut() {
                if key != "faces" {
                    stretch(value, factor);
                }
            }
            *shape = value.try_into().unwrap();
        }
        let mut denser = scene.clone();
        denser.fluid.density *= 3.0;
        for fidelity in FIDELITIES {
            let m = added_mass(&scene, fidelity);
            let large = added_mass(&larger, fidelity);
            let back = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
                large[(i, j)] / factor.powi(3 + (i / 3 % 2 + j / 3 % 2) as i32)
            });
            let error = off(&back, &m);
            let limit = if fidelity == Fidelity::Reduced { 1e-6 } else { 1e-9 };
            prop_assert!(error <= limit, "{fidelity:?}: {error:e}");
            let error = off(&added_mass(&denser, fidelity), &(3.0 * m));
            prop_assert!(error <= 1e-13, "{fidelity:?}: {error:e}");
        }
    }

    /// The bodies' rows, in another order.
    #[test]
    fn it_does_not_depend_on_the_order_of_bodies(scene in drifting()) {
        let count = scene.bodies.len();
        let mut turned = scene.clone();
        turned.bodies.reverse();
        let place = |i: usize| 6 * (count - 1 - i / 6) + i % 6;
        for fidelity in FIDELITIES {
            let (m, other) = (added_mass(&scene, fidelity), added_mass(&turned, fidelity));
            let back = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| other[(place(i), place(j))]);
            let error = off(&back, &m);
            prop_assert!(error <= 1e-9, "{fidelity:?}: {error:e}");
        }
    }
}

fn stretch(value: &mut toml::Value, factor: f64) {
    match value {
        toml::Value::Float(x) => *x *= factor,
        toml::Value::Array(all) => all.iter_mut().for_each(|v| stretch(v, factor)),
        _ => {}
    }
}
