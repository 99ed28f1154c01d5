//! Spheres and ellipsoids in the flow of sources.

use super::{exact, longest, surface};
use crate::support::bodies::off_ellipsoid;
use hydrograd::Error;
use hydrograd::adjoint::lie::{Vec3, Vec6};
use hydrograd::boundary::{BodyBoundary, MfsSettings, Response};
use hydrograd::scene::Shape;
use std::f64::consts::PI;
use std::path::Path;

const ELLIPSOIDS: [[f64; 3]; 12] = [
    [1.0, 0.2, 1.0],
    [1.0, 0.1, 1.0],
    [1.0, 0.15, 1.0],
    [1.0, 1.0, 0.03],
    [5.0, 1.0, 5.0],
    [5.0, 1.0, 1.0],
    [1.0, 1.0, 20.0],
    [3.0, 2.0, 1.0],
    [0.5, 4.0, 2.0],
    [1.0, 0.7, 0.02],
    [1.0, 0.999, 0.998],
    [1e-4, 1.0, 1e-4],
];

/// The normal velocity that sources at the resolved gap leave on the surface.
#[test]
fn ellipsoids_answer_sources_at_the_resolved_gap() {
    for (i, semi_axes) in ELLIPSOIDS.into_iter().enumerate() {
        // The smallest gap is the dearest: for some.
        let gaps = [1.0, 0.2, 0.1];
        for gap in &gaps[..if i % 6 == 1 { 3 } else { 2 }] {
            let body = exact("body", semi_axes, gap * longest(semi_axes));
            assert!(
                body.residual < 4e-5,
                "{semi_axes:?} {gap}: {:e}",
                body.residual
            );
            assert!(body.warnings().is_empty(), "{:?}", body.warnings());
            assert!(body.residual > 0.0 && body.harmonics().1 > 0);
        }
    }
    let coin = exact("coin", [1.0, 0.1, 1.0], 0.05);
    assert!(coin.residual < 1e-4, "{:e}", coin.residual);
    // What isn't reached is said.
    let near = exact("needle", [1.0, 0.01, 0.01], 0.025);
    assert!(near.residual > 1e-4);
    let text = near.warnings().join(" ");
    assert!(
        text.contains("\"needle\"") && text.contains("2.500e-2 m"),
        "{text}"
    );
}

/// The flow of source and body together doesn't pass through the surface: its potential there, by
/// differences along the normal.
#[test]
fn no_water_passes_the_surface() {
    for (semi_axes, gap) in [
        ([3.0, 2.0, 1.0], 0.5),
        ([1.0, 0.2, 1.0], 0.2),
        ([1.0, 1.0, 0.1], 0.5),
        ([1.0, 1.0, 5.0], 0.5),
        ([1.0, 0.5, 0.1], 0.3),
    ] {
        let body = exact("body", semi_axes, gap / 2.0);
        let sources = off_ellipsoid(semi_axes, gap, 7);
        let axes = Vec3::from(semi_axes);
        let step = 1e-3
            * semi_axes
                .iter()
                .fold(f64::INFINITY, |m: f64, a| m.min(*a))
                .powi(2);
        let feet = off_ellipsoid(semi_axes, 0.0, 40);
        let weights = [-25.0, 48.0, -36.0, 16.0, -3.0].map(|w| w / 12.0 / step);
        let normals: Vec<Vec3> = feet
            .iter()
            .map(|x| x.component_div(&axes).component_div(&axes).normalize())
            .collect();
        let lines: Vec<Vec3> = feet
            .iter()
            .zip(&normals)
            .flat_map(|(x, n)| (0..5).map(move |k| x + n * (step * f64::from(k))))
            .collect();
        let own = body.scattered(&sources, &lines).unwrap();
        let mut slopes = Vec::new();
        for (i, (x, n)) in feet.iter().zip(&normals).enumerate() {
            for (j, y) in sources.iter().enumerate() {
                let away = x - y;
                let asked = n.dot(&away) / away.norm().powi(3);
                let slope: f64 = (0..5).map(|k| weights[k] * own[(5 * i + k, j)]).sum();
                // Velocities are −∇φ.
                slopes.push((asked, slope - asked));
            }
        }
        let largest = slopes.iter().fold(0.0f64, |m, s| m.max(s.0.abs()));
        let left = slopes.iter().fold(0.0f64, |m, s| m.max(s.1.abs()));
        assert!(
            left < 1e-5 * largest,
            "{semi_axes:?}: {left:e} of {largest:e}"
        );
    }
}

/// Φ_i(y) = (1/4π) ∮ v_i (1/|x − y| + scattered) dA: the flow of a motion by the flow around a source.
#[test]
fn motion_and_scattering_belong_together() {
    for semi_axes in ELLIPSOIDS.into_iter().take(11) {
        let gap = 0.5 * longest(semi_axes);
        let body = exact("body", semi_axes, gap);
        let sources = off_ellipsoid(semi_axes, gap, 5);
        let points = surface(semi_axes, 64, 80);
        let at: Vec<Vec3> = points.iter().map(|p| p.0).collect();
        let scattered = body.scattered(&sources, &at).unwrap();
        let exact = body.radiated(&sources).unwrap();
        let mut found = vec![Vec6::zeros(); sources.len()];
        for (i, (x, n, area)) in points.iter().enumerate() {
            let moment = x.cross(n);
            let flux = Vec6::new(n.x, n.y, n.z, moment.x, moment.y, moment.z) * *area;
            for (j, y) in sources.iter().enumerate() {
                found[j] += flux * ((1.0 / (x - y).norm() + scattered[(i, j)]) / (4.0 * PI));
            }
        }
        for k in 0..6 {
            let size = (0..5).fold(0.0f64, |m, j| m.max(exact[(j, k)].abs()));
            for (j, f) in found.iter().enumerate() {
                let error = (f[k] - exact[(j, k)]).abs();
                assert!(
                    error <= 1e-8 * size + 1e-10,
                    "{semi_axes:?} {j} {k}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn nearly_a_sphere_scatters_like_one() {
    let sphere = exact("ball", [1.0; 3], 0.2);
    let points = off_ellipsoid([1.0; 3], 0.2, 30);
    let expected = sphere.scattered(&points, &points).unwrap();
    for d in [1e-3, 1e-5, 1e-8, 1e-12] {
        for axes in [
            [1.0 + d, 1.0, 1.0 - d],
            [1.0, 1.0, 1.0 - d],
            [1.0 + d, 1.0, 1.0],
        ] {
            let body = exact("ball", axes, 0.2);
            let got = body.scattered(&points, &points).unwrap();
            let error = (got - &expected).norm_max();
            assert!(error < 30.0 * d + 1e-7, "{axes:?}: {error:e}");
        }
    }
}

/// Axes that are made more and more equal: the answer tends to the round body's with the difference.
#[test]
fn nearly_equal_axes_are_no_exception() {
    let points = [Vec3::new(0.6, 1.1, 0.5), Vec3::new(0.5, 0.8, -0.9)];
    let answer = |b: f64, c: f64| {
        let body = exact("body", [1.0, b, c], 0.3);
        body.scattered(&points[..1], &points[1..]).unwrap()[(0, 0)]
    };
    for (b, c) in [(0.3, 0.3), (1.0, 0.3), (1e-3, 1e-3)] {
        let round = answer(b, c);
        let slope = |d: f64| (answer(b - d * b, c) - round) / (d * round);
        let limit = slope(1e-4);
        for d in [1e-5, 1e-6, 1e-7, 1e-8] {
            let off = slope(d) / limit - 1.0;
            assert!(off.abs() < 2e-3, "{b} {c} {d}: {off:e}");
        }
    }
}

/// Axes in any order, in any unit, and sources and points exchanged.
#[test]
fn scattering_is_symmetric_and_knows_no_unit() {
    let axes = [3.0, 2.0, 1.0];
    let body = exact("body", axes, 0.5);
    let sources = off_ellipsoid(axes, 0.6, 20);
    let points = off_ellipsoid(axes, 1.1, 33);
    let there = body.scattered(&sources, &points).unwrap();
    let back = body.scattered(&points, &sources).unwrap();
    assert!((&there - back.transpose()).norm_max() < 1e-13);
    let turn = |x: &Vec3| Vec3::new(x.z, x.x, x.y);
    for scale in [1e-6, 1.0, 1e6] {
        let moved = exact("body", [scale, 3.0 * scale, 2.0 * scale], 0.5 * scale);
        let map = |list: &[Vec3]| list.iter().map(|x| turn(x) * scale).collect::<Vec<_>>();
        let got = moved.scattered(&map(&sources), &map(&points)).unwrap();
        assert!((faer::Scale(scale) * got - &there).norm_max() < 1e-12);
    }
    // A source that is a point too.
    let same = body.scattered(&sources, &sources).unwrap();
    let mut more = sources.clone();
    more.push(Vec3::new(9.0, 0.0, 0.0));
    let other = body.scattered(&sources, &more).unwrap();
    assert!((other.subrows(0, 20) - same).norm_max() < 1e-8);
    assert_eq!(body.scattered(&[], &points).unwrap().shape(), (33, 0));
    assert_eq!(body.scattered(&points, &[]).unwrap().shape(), (0, 33));
}

/// Between the resolved gap and half of it answers fade; far below they are refused.
#[test]
fn points_too_near_are_refused() {
    let axes = [1.0, 0.2, 1.0];
    let fine = exact("coin", axes, 0.05);
    let body = exact("coin", axes, 0.4);
    for (gap, limit) in [(0.4, 1e-8), (0.2, 1e-4)] {
        let points = off_ellipsoid(axes, gap, 50);
        let (got, exact) = (
            body.scattered(&points, &points).unwrap(),
            fine.scattered(&points, &points).unwrap(),
        );
        let error = (&got - &exact).norm_max() / exact.norm_max();
        assert!(error < limit, "{gap}: {error:e}");
    }
    let points = off_ellipsoid(axes, 0.02, 50);
    let error = body.scattered(&points, &points).unwrap_err();
    assert!(matches!(error, Error::Unresolved { .. }));
    let text = error.to_string();
    assert!(
        text.contains("\"coin\"") && text.contains("4.000000e-1 m"),
        "{text}"
    );
}

/// Against fundamental solutions on a mesh, which know nothing of this.
#[test]
fn meshes_scatter_nearly_the_same() {
    for semi_axes in [[1.0, 0.4, 1.0], [1.5, 1.0, 0.5]] {
        let shape = Shape::Ellipsoid {
            semi_axes,
            faces: None,
        };
        let mesh = hydrograd::shape::build(&shape, Path::new("."), Some(1280)).unwrap();
        let mesh = BodyBoundary::new("body", &mesh, &MfsSettings::default()).unwrap();
        let body = exact("body", semi_axes, 0.3);
        let points = off_ellipsoid(semi_axes, 0.4, 40);
        for (a, b) in [
            (
                mesh.scattered(&points, &points).unwrap(),
                body.scattered(&points, &points).unwrap(),
            ),
            (
                mesh.radiated(&points).unwrap(),
                body.radiated(&points).unwrap(),
            ),
        ] {
            let error = (&a - &b).norm_max() / b.norm_max();
            assert!(error < 0.02, "{semi_axes:?}: {error:e}");
        }
    }
}

#[test]
fn sphere_scatters_as_its_multipoles() {
    let radius = 0.7f64;
    let body = exact("ball", [radius; 3], 0.05);
    for gap in [0.5, 0.1] {
        let y = Vec3::new(0.36, 0.48, 0.8) * radius * (1.0 + gap);
        for x in [
            y,
            -y,
            Vec3::new(0.0, 0.0, 1.0) * radius,
            Vec3::new(-0.5, 2.0, 0.1),
            Vec3::new(0.6, 0.5, 0.7),
        ] {
            let cosine = x.dot(&y) / (x.norm() * y.norm());
            let ratio = radius * radius / (x.norm() * y.norm());
            let (mut p, mut q) = (1.0, 0.0);
            let mut power = ratio;
            let mut series = 0.0;
            for l in 0..2000 {
                let l = f64::from(l);
                series += l / (l + 1.0) * power * p / radius;
                power *= ratio;
                (p, q) = (((2.0 * l + 1.0) * cosine * p - l * q) / (l + 1.0), p);
            }
            let got = body.scattered(&[y], &[x]).unwrap()[(0, 0)];
            assert!(
                (got - series).abs() < 1e-13 * (1.0 + series.abs()),
                "{gap} {x}"
            );
        }
    }
}

/// Points in the planes and on the axes of symmetry, some of them on the rim of a thin body, belong to
/// the points beside them.
#[test]
fn planes_of_symmetry_are_no_exception() {
    for axes in [
        [1.0, 0.2, 1.0],
        [3.0, 2.0, 1.0],
        [1.0, 5.0, 1.0],
        [1.0, 0.7, 0.02],
    ] {
        let body = exact("body", axes, 0.5 * longest(axes));
        let scale = Vec3::from(axes);
        for d in [
            Vec3::x(),
            Vec3::y(),
            Vec3::z(),
            Vec3::new(0.6, 0.8, 0.0),
            Vec3::new(0.0, 0.6, 0.8),
            Vec3::new(-0.8, 0.0, 0.6),
        ] {
            for gap in [1e-3, 0.3] {
                let x = d.component_mul(&scale) + d.component_div(&scale).normalize() * gap;
                let side = Vec3::repeat(1e-10);
                let points = [x, x + side, x - side];
                let far = off_ellipsoid(axes, 0.5 * longest(axes), 3);
                for field in [
                    body.radiated(&points).unwrap(),
                    body.scattered(&far, &points).unwrap(),
                ] {
                    let (low, high) = (field.row(1) - field.row(0), field.row(2) - field.row(0));
                    let apart = low.norm_max().max(high.norm_max());
                    assert!(
                        apart < 1e-6 * field.norm_max(),
                        "{axes:?} {d} {gap}: {apart:e}"
                    );
                    assert!(apart > 0.0);
                }
            }
        }
    }
}
