//! Spheres and ellipsoids by formula, against what is known in closed form and against each other.

mod lamb;
mod references;
mod scattering;

use crate::support::bodies::off_ellipsoid;
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::{ExactBoundary, Response};
use hydrograd::{Body, Error, Fidelity, Fluid, Scene, Settings, Shape, Simulator};
use std::f64::consts::PI;

/// Points on the ellipsoid, m, with ∫ f dA ≈ Σ weight · f: Gauss–Legendre in height, even in turn.
fn surface(semi_axes: [f64; 3], rings: usize, around: usize) -> Vec<(Vec3, Vec3, f64)> {
    let (nodes, weights) = gauss_legendre(rings);
    let axes = Vec3::from(semi_axes);
    let mut out = Vec::new();
    for (z, w) in nodes.iter().zip(&weights) {
        for k in 0..around {
            let turn = 2.0 * PI * (k as f64 + 0.5) / around as f64;
            let r = (1.0 - z * z).sqrt();
            let unit = Vec3::new(r * turn.cos(), r * turn.sin(), *z);
            // Gradient of Σ (x/a)², and dA = abc |n/a| dΩ.
            let n = unit.component_div(&axes);
            let area = axes.product() * n.norm() * w * 2.0 * PI / around as f64;
            out.push((unit.component_mul(&axes), n.normalize(), area));
        }
    }
    out
}

/// Nodes and weights on [−1, 1].
fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut nodes = Vec::new();
    let mut weights = Vec::new();
    for k in 0..n {
        let mut x = (PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 0.0;
        for _ in 0..100 {
            let (mut p, mut q) = (1.0, 0.0);
            for l in 0..n {
                let l = l as f64;
                (p, q) = (((2.0 * l + 1.0) * x * p - l * q) / (l + 1.0), p);
            }
            slope = n as f64 * (x * p - q) / (x * x - 1.0);
            let step = p / slope;
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        nodes.push(x);
        weights.push(2.0 / ((1.0 - x * x) * slope * slope));
    }
    (nodes, weights)
}

fn exact(name: &str, semi_axes: [f64; 3], gap: f64) -> ExactBoundary {
    ExactBoundary::new(name, semi_axes, &Pose::identity(), gap).unwrap()
}

fn longest(semi_axes: [f64; 3]) -> f64 {
    semi_axes.iter().fold(0.0, |m, a| a.max(m))
}

#[test]
fn a_pose_moves_the_shape() {
    let axes = [0.6, 0.3, 0.2];
    let pose = Pose::new(
        exp_matrix(&Vec3::new(0.4, -1.1, 0.3)),
        Vec3::new(0.7, -0.2, 1.3),
    );
    let here = exact("body", axes, 0.2);
    let there = ExactBoundary::new("body", axes, &pose, 0.2).unwrap();
    // The flow of a body twist is that of the same motion seen in the shape's frame.
    let points = [Vec3::new(0.9, 0.1, -0.3), Vec3::new(-0.2, 0.8, 0.5)];
    let moved = points.map(|x| pose.apply(&x));
    let (own, seen) = (
        here.radiated(&points).unwrap(),
        there.radiated(&moved).unwrap(),
    );
    for k in 0..6 {
        let mut v = Vec6::zeros();
        v[k] = 1.0;
        let inside = pose.twist_to_body(&v);
        for i in 0..2 {
            let expected: f64 = (0..6).map(|j| own[(i, j)] * inside[j]).sum();
            assert!((seen[(i, k)] - expected).abs() < 1e-14);
        }
        let energy = inside.dot(&(here.added_mass() * inside));
        assert!((there.added_mass()[(k, k)] / energy - 1.0).abs() < 1e-13);
    }
    assert_eq!(there.added_mass(), there.added_mass().transpose());
    for axes in [axes, [0.3; 3]] {
        let moving = ExactBoundary::new("body", axes, &pose, 0.2).unwrap();
        let (a, b) = (
            moving.scattered(&moved, &moved).unwrap(),
            exact("body", axes, 0.2)
                .scattered(&points, &points)
                .unwrap(),
        );
        assert!((a - b).norm_max() < 1e-14);
    }
}

#[test]
fn wrong_input_is_refused_with_its_numbers() {
    let message = |axes: [f64; 3], pose: &Pose, gap: f64| {
        let error = ExactBoundary::new("coin", axes, pose, gap).unwrap_err();
        assert!(matches!(error, Error::Input { .. }), "{error}");
        error.to_string()
    };
    let still = Pose::identity();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let text = message([1.0, bad, 1.0], &still, 0.1);
        assert!(text.contains("\"coin\": semi_axes[1]: got"), "{text}");
        let text = message([1.0; 3], &still, bad);
        assert!(text.contains("\"coin\": resolved gap: got"), "{text}");
        let text = hydrograd::boundary::exact::lamb::added_mass([bad, 1.0, 1.0])
            .unwrap_err()
            .to_string();
        assert!(text.contains("semi_axes[0]: got"), "{text}");
    }
    let error = ExactBoundary::new("coin", [1.0, 0.1, 1.0], &still, 1e-3).unwrap_err();
    assert!(matches!(error, Error::Unresolved { .. }));
    let text = error.to_string();
    assert!(
        text.contains("\"coin\"") && text.contains("1.000000e-3"),
        "{text}"
    );
    let mut turned = still;
    turned.rotation[(0, 1)] = 0.5;
    assert!(message([1.0; 3], &turned, 0.1).contains("rotation"));
    let mut nowhere = still;
    nowhere.translation.x = f64::NAN;
    assert!(message([1.0; 3], &nowhere, 0.1).contains("position"));

    let body = exact("coin", [1.0, 0.2, 1.0], 0.1);
    let outside = Vec3::new(2.0, 0.0, 0.0);
    for bad in [
        Vec3::zeros(),
        Vec3::new(0.5, 0.1, 0.0),
        Vec3::new(0.0, f64::NAN, 0.0),
        Vec3::new(f64::INFINITY, 0.0, 0.0),
    ] {
        for error in [
            body.radiated(&[outside, bad]).unwrap_err(),
            body.scattered(&[outside], &[bad]).unwrap_err(),
            body.scattered(&[bad], &[outside]).unwrap_err(),
        ] {
            let text = error.to_string();
            assert!(text.contains("\"coin\": point: got ("), "{text}");
        }
    }
}

/// The thinnest, the smallest, the largest that are taken: finite answers or errors.
#[test]
fn extremes_give_numbers() {
    for axes in [
        [1e-30, 1e30, 1.0],
        [1e30, 1e30, 1e-30],
        [1e30, 1e-30, 1e-30],
        [1e-30; 3],
        [1e30; 3],
        [1.0, 1e-12, 1.0],
        [1.0, 1.0 + 1e-15, 1.0],
        [1.0, 1.0 - 1e-10, 1e-3],
    ] {
        for gap in [1e-2, 0.3, 1e6] {
            let gap = gap * longest(axes);
            let body = match ExactBoundary::new("body", axes, &Pose::identity(), gap) {
                Ok(body) => body,
                Err(error) => {
                    assert!(matches!(error, Error::Unresolved { .. }), "{error}");
                    continue;
                }
            };
            assert!(body.residual < 1e-4, "{axes:?} {gap}: {:e}", body.residual);
            assert!(body.added_mass().iter().all(|x| x.is_finite()), "{axes:?}");
            let points = off_ellipsoid(axes, gap, 9);
            for field in [
                body.radiated(&points).unwrap(),
                body.scattered(&points, &points).unwrap(),
            ] {
                assert!(field.is_all_finite(), "{axes:?} {gap}");
            }
        }
    }
}

/// A needle has so little area that its root is a small part of its length: nothing is asked of the flow near it, and it has its formula.
#[test]
fn a_needle_alone_has_its_formula() {
    for semi_axes in [[1.0, 3e-5, 3e-5], [2e-5, 4e-5, 1.0]] {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.add(Body::new(Shape::ellipsoid(semi_axes)).density(1200.0));
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let found = simulator.added_mass().unwrap().own(0);
        let exact = hydrograd::boundary::exact::lamb::added_mass(semi_axes).unwrap();
        let exact = exact * scene.fluid.density;
        for i in 0..6 {
            let off = (found[(i, i)] - exact[(i, i)]).abs();
            assert!(off <= 1e-12 * exact[(i, i)], "{semi_axes:?} {i}: {off:e}");
        }
    }
}
