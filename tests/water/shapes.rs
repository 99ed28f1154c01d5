//! Derivatives of couplings with respect to shapes.

use crate::support::mesh;
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::boundary::PanelBoundary;
use hydrograd::coupling::reduced::compress::{CompressSettings, compress};
use hydrograd::coupling::reduced::{Cutoff, Reduced, ReducedBody, ShapeSlope};
use hydrograd::coupling::{Coupling, Direction, Linearise, ShapeTerm};
use hydrograd::scene::{Shape, Wall};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

fn poses() -> Vec<Pose> {
    vec![
        Pose::new(
            exp_matrix(&Vec3::new(0.3, -0.2, 0.5)),
            Vec3::new(0.0, 0.0, 0.9),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(-0.4, 0.1, 0.2)),
            Vec3::new(0.2, 1.0, 1.1),
        ),
    ]
}

/// E(x, y), or its slope along z.
fn energy(coupling: &dyn Linearise, x: &DVector<f64>, y: &DVector<f64>, z: Option<&[Vec6]>) -> f64 {
    let basis = DMatrix::from_columns(&[y.clone()]);
    let at = coupling.linearise(&poses(), &basis).unwrap();
    let (x, y) = (Direction::Twist(x), Direction::Twist(y));
    let found = at.vjp(x, y).unwrap();
    match (z, y) {
        (Some(z), _) => found.wrench.iter().zip(z).map(|(w, z)| w.dot(z)).sum(),
        (None, Direction::Twist(y)) => found.momentum_x.dot(y),
        _ => f64::NAN,
    }
}

/// A compressed body, and how it changes by itself: points, modes, strengths and added mass each along fixed samples.
struct Changing {
    body: ReducedBody,
    modes: DMatrix<f64>,
    slope: ShapeSlope,
}

impl Changing {
    fn new(shape: &Shape, seed: u64) -> Self {
        let mesh = mesh(shape, 160);
        let response = PanelBoundary::new("b", &mesh).unwrap();
        let settings = CompressSettings {
            rank: Some(24),
            tolerance: 1e-2,
            resolved_gap: Some(0.3),
        };
        let body = compress("b", &mesh, &response, &settings, &[]).unwrap();
        let mut next = Samples::new(seed);
        let mut sample = || next.number();
        let parts = body.parts();
        let like = |m: &DMatrix<f64>, s: &mut dyn FnMut() -> f64| {
            let scale = 0.3 * m.amax();
            DMatrix::from_fn(m.nrows(), m.ncols(), |_, _| scale * s())
        };
        let modes = like(&parts.modes, &mut sample);
        let strengths = like(&parts.strengths, &mut sample);
        let half = 0.1 * parts.added_mass.map(|x| x * sample());
        let slope = ShapeSlope {
            points: (parts.points.iter())
                .map(|_| 0.1 * Vec3::from_fn(|_, _| sample()))
                .collect(),
            strengths,
            solution: &modes * parts.modes.transpose() + &parts.modes * modes.transpose(),
            added_mass: half + half.transpose(),
        };
        Self { body, modes, slope }
    }

    fn at(&self, h: f64) -> Arc<ReducedBody> {
        let mut parts = self.body.parts().clone();
        for (p, d) in parts.points.iter_mut().zip(&self.slope.points) {
            *p += h * d;
        }
        parts.modes += h * &self.modes;
        parts.strengths += h * &self.slope.strengths;
        parts.added_mass += h * self.slope.added_mass;
        Arc::new(ReducedBody::new(parts).unwrap())
    }
}

#[test]
fn slopes_of_compressed_bodies_against_differences() {
    let bodies = [
        Changing::new(&Shape::cuboid([0.5, 0.4, 0.6]), 3),
        Changing::new(&Shape::ellipsoid([0.6, 0.3, 0.4]), 4),
    ];
    let wall = Wall::rigid([0.0, 0.0, 0.0], [0.1, 0.0, 1.0]);
    let fading = Cutoff {
        near: 0.5,
        far: 2.0,
    };
    let mut next = Samples::new(11);
    let mut vector = |n: usize| DVector::from_fn(n, |_, _| next.number());
    for (walls, cutoff) in [
        (vec![], None),
        (vec![wall], None),
        (vec![wall], Some(fading)),
    ] {
        for changed in 0..2 {
            let at = |h: f64| {
                let of = |b: usize| bodies[b].at(if b == changed { h } else { 0.0 });
                Reduced::new(vec![of(0), of(1)], &walls, |_, _| cutoff).unwrap()
            };
            let coupling = at(0.0)
                .with_shapes(vec![(changed, bodies[changed].slope.clone())])
                .unwrap();
            assert_eq!(coupling.shape_parameters(), 1);
            let (x, y, z) = (vector(12), vector(12), vector(12));
            let z = [0, 6].map(|i| z.fixed_rows::<6>(i).into_owned());
            for along in [None, Some(z.as_slice())] {
                let basis = DMatrix::from_columns(&[y.clone()]);
                let linearised = coupling.linearise(&poses(), &basis).unwrap();
                let one = DVector::from_element(1, 1.0);
                let term = ShapeTerm {
                    weight: 0.7,
                    x: Direction::Twist(&x),
                    y: Direction::Basis(&one),
                    along,
                };
                let found = linearised.shape_vjp(&[term]).unwrap()[0];
                let value = |h: f64| 0.7 * energy(&at(h), &x, &y, along);
                let central = |h: f64| (value(h) - value(-h)) / (2.0 * h);
                let h = 2e-3;
                let differences = (4.0 * central(0.5 * h) - central(h)) / 3.0;
                let off = (found / differences - 1.0).abs();
                println!(
                    "{} walls, fading {}, body {changed}, slope {}: {found:.6e} {off:.1e}",
                    walls.len(),
                    cutoff.is_some(),
                    along.is_some()
                );
                assert!(off < 1e-6, "{found:e} {differences:e}");
            }
        }
    }
}
