//! Limits of lubrication that are known in closed form, or of one dimension.

use crate::adjoint::lie::{Mat6, Pose, Vec3, exp_matrix};
use crate::coupling::lubrication::{Bearing, BearingSurface, PlacedBearing};
use crate::geometry::{HalfSpace, Opposite};
use crate::scene::Shape;
use crate::shape;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

/// Of surfaces that are as good as smooth, a shape's and another's, or the wall z = 0.
const SMOOTH: f64 = 1e-9;

fn bearing(own: &Shape, faces: usize, other: Option<&Shape>, reach: f64) -> Bearing {
    let mesh = |s: &Shape| shape::build(s, Path::new("."), Some(faces)).unwrap();
    let solid = |s: &Shape| shape::solid(s, Pose::identity()).unwrap();
    let opposite = match other {
        None => Opposite::of_wall(HalfSpace::new(&Vec3::zeros(), &Vec3::z()).unwrap()),
        Some(other) => Opposite::of_body(solid(other).as_ref(), &mesh(other)),
    };
    Bearing {
        surface: Arc::new(BearingSurface::new(&mesh(own), solid(own).as_ref())),
        opposite: Arc::new(opposite),
        reach,
    }
}

fn raised(height: f64) -> Pose {
    Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(0.0, 0.0, height))
}

fn at(bearing: &Bearing, height: f64) -> PlacedBearing {
    bearing
        .placed(&raised(height), SMOOTH)
        .unwrap()
        .expect("a film")
}

fn near(found: f64, exact: f64, part: f64) {
    let error = found / exact - 1.0;
    assert!(error.abs() < part, "{found} for {exact}: {error:+.4}");
}

/// 3πμR⁴/2h³ for a disc, less than a hundredth of it for its mesh being a polygon; μLw³/h³ for a long strip, less at its ends by Saint-Venant's 192/π⁵ of the width over
/// the length; πμR⁴/2h about the axis and πμR²/h along the disc.
#[test]
fn parallel_faces() {
    let disc = bearing(&Shape::cylinder(1.0, 0.25), 2000, None, 1.0);
    let strip = bearing(&Shape::cuboid([1.0, 12.0, 0.6]), 2000, None, 1.0);
    for h in [1e-2, 1e-3, 1e-4] {
        let c = at(&disc, 0.125 + h).damping;
        near(c[(2, 2)], 1.5 * PI / h.powi(3), 0.015);
        near(c[(5, 5)], 0.5 * PI / h, 0.01);
        near(c[(0, 0)], PI / h, 0.01);
        let c = at(&strip, 0.3 + h).damping;
        near(c[(2, 2)], 12.0 * (1.0 - 0.6274 / 12.0) / h.powi(3), 0.03);
    }
}

/// 6πμR²/h for a ball over a wall and a quarter of it for two, on meshes whose edges are a tenth of the radius, which the spot of pressure is far smaller than. At a
/// hundredth the ball isn't its parabola any more.
#[test]
fn balls() {
    let wall = bearing(&Shape::sphere(1.0), 1280, None, 1.0);
    let two = bearing(&Shape::sphere(1.0), 1280, Some(&Shape::sphere(1.0)), 1.0);
    for (h, part) in [(1e-2, 0.06), (1e-3, 0.012), (1e-4, 0.004)] {
        near(at(&wall, 1.0 + h).damping[(2, 2)], 6.0 * PI / h, part);
        near(at(&two, 2.0 + h).damping[(2, 2)], 1.5 * PI / h, part);
    }
    // A flat face opposite a ball, solved on either.
    let on_box = bearing(
        &Shape::cuboid([4.0, 4.0, 4.0]),
        1280,
        Some(&Shape::sphere(1.0)),
        1.0,
    );
    near(
        at(&on_box, 3.0 + 1e-3).damping[(2, 2)],
        6.0 * PI / 1e-3,
        0.02,
    );
}

/// What a ball that slides and rolls by a wall meets grows by a logarithm: 16/5 πμR ln(R/h) along, 4/5 across to turning, 16/5 against turning (A. Goldman et al., 1967):
/// pressure by wedges, the shear of its flow, and Couette's together.
#[test]
fn sliding_and_rolling_balls() {
    let ball = bearing(&Shape::sphere(1.0), 1280, None, 1.0);
    let c = |h: f64| at(&ball, 1.0 + h).damping;
    let [far, close]: [Mat6; 2] = [1e-3, 1e-4].map(c);
    let grown = (close - far) / (PI * f64::ln(10.0));
    near(grown[(0, 0)], 3.2, 0.01);
    near(grown[(4, 4)], 3.2, 0.01);
    near(grown[(0, 4)].abs(), 0.8, 0.01);
    // Sliding by a wall doesn't lift a ball.
    assert!(close[(0, 2)].abs() < 1e-3 * close[(0, 0)], "{close}");
}

/// A tilted strip whose gap goes from h₁ to h₂: squeezed, 12μL min over c of ∫ (x − c)²/h³ dx; sliding, Reynolds' bearing, W = 6μU(B/(h₂ − h₁))² L (ln k − 2(k − 1)/(k + 1)), k = h₂/h₁.
#[test]
fn tilted_strips_are_those_of_one_dimension() {
    let (width, long, thick) = (1.0, 12.0, 0.6);
    let strip = bearing(&Shape::cuboid([width, long, thick]), 2000, None, 1.0);
    let ends = 1.0 - 0.6274 * width / long;
    for tilt in [0.001_f64, 0.004] {
        let low = 1e-3;
        let turn = exp_matrix(&Vec3::new(0.0, -tilt, 0.0));
        let height = low + 0.5 * (width * tilt.sin() + thick * tilt.cos());
        let pose = Pose::new(turn, Vec3::new(0.0, 0.0, height));
        let c = strip
            .placed(&pose, SMOOTH)
            .unwrap()
            .expect("a film")
            .damping;
        let steps = 4000;
        let dx = width / f64::from(steps);
        let sum = |power: i32| -> f64 {
            let at = |k: i32| (f64::from(k) + 0.5) * dx;
            let h = |x: f64| low + x * tilt;
            (0..steps)
                .map(|k| at(k).powi(power) / h(at(k)).powi(3) * dx)
                .sum()
        };
        let squeezed = 12.0 * long * (sum(2) - sum(1).powi(2) / sum(0));
        near(c[(2, 2)], ends * squeezed, 0.03);
        let k = 1.0 + width * tilt / low;
        let lift = 6.0 * long / tilt.powi(2) * (k.ln() - 2.0 * (k - 1.0) / (k + 1.0));
        near(c[(2, 0)].abs(), ends * lift, 0.04);
    }
}

/// Roughness adds to the thickness, and holds it finite in touch and beneath.
#[test]
fn roughness_ends_the_growth() {
    let disc = bearing(&Shape::cylinder(1.0, 0.25), 1280, None, 1.0);
    let r = 1e-3;
    let c = |d: f64| disc.placed(&raised(0.125 + d), r).unwrap().unwrap().damping[(2, 2)];
    let touching = 1.5 * PI / r.powi(3);
    near(c(0.0), touching, 0.015);
    near(c(r), touching / 8.0, 0.015);
    // Sunk: half of it is left, and no more is lost.
    near(c(-0.1), 8.0 * touching, 0.02);
    assert!(c(-1e-3) < c(-1e-2));
}

/// Bodies of all sizes are alike: C/μ over the length.
#[test]
fn it_has_no_scale() {
    let c = |size: f64| {
        let disc = bearing(&Shape::cylinder(size, 0.25 * size), 1280, None, size);
        let turn = exp_matrix(&Vec3::new(0.004, -0.003, 0.2));
        let pose = Pose::new(turn, Vec3::new(0.0, 0.0, 0.14 * size));
        disc.placed(&pose, 1e-4 * size).unwrap().unwrap().damping
    };
    let [one, small, large] = [1.0, 1e-3, 1e3].map(c);
    for (other, size) in [(small, 1e-3_f64), (large, 1e3)] {
        for i in 0..6 {
            for j in 0..6 {
                let power = 1 + i32::from(i > 2) + i32::from(j > 2);
                let scaled = other[(i, j)] / size.powi(power);
                assert!((scaled - one[(i, j)]).abs() < 1e-6 * one.amax(), "{i} {j}");
            }
        }
    }
}

/// It takes energy away, whatever moves; and apart there is none.
#[test]
fn it_is_semi_definite_and_ends() {
    let blocks = bearing(
        &Shape::cuboid([0.6, 0.5, 0.4]),
        500,
        Some(&Shape::cuboid([1.0, 1.0, 0.4])),
        0.5,
    );
    let turn = exp_matrix(&Vec3::new(0.02, -0.05, 0.4));
    let pose = |z: f64| Pose::new(turn, Vec3::new(0.3, 0.2, z));
    let c = blocks.placed(&pose(0.43), 1e-4).unwrap().unwrap().damping;
    let least = c.symmetric_eigenvalues().min();
    assert!(least > -1e-12 * c.amax(), "{least}");
    assert!(blocks.placed(&pose(1.2), 1e-4).unwrap().is_none());
}
