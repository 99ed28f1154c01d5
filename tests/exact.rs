//! Spheres and ellipsoids by formula, against what is known in closed form and against each other.

use hydrograd::Error;
use hydrograd::adjoint::lie::{Mat6, Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::exact::lamb;
use hydrograd::boundary::{BodyBoundary, ExactBoundary, Response, Settings};
use hydrograd::scene::Shape;
use std::f64::consts::PI;
use std::path::Path;

/// Semi-axes; added mass in translation along and rotation about x, y, z at unit density, by
/// independent quadrature of Lamb's integrals.
const LAMB: [([f64; 3], [f64; 6]); 6] = [
    (
        [1.0, 1.0, 1.0],
        [
            2.0943951023931957,
            2.0943951023931957,
            2.0943951023931957,
            0.0,
            0.0,
            0.0,
        ],
    ),
    (
        [2.0, 1.0, 1.0],
        [
            1.7594179600221793,
            5.899579467820825,
            5.899579467820825,
            0.0,
            2.0057929172153726,
            2.0057929172153726,
        ],
    ),
    (
        [1.0, 1.0, 0.5],
        [
            0.6483952523583104,
            0.6483952523583104,
            2.3353772201132488,
            0.1772789898160723,
            0.1772789898160723,
            0.0,
        ],
    ),
    (
        [1.0, 1.0, 0.1],
        [
            0.031333853344129144,
            0.031333853344129144,
            2.5904017967032096,
            0.3403414985758897,
            0.3403414985758897,
            0.0,
        ],
    ),
    (
        [5.0, 1.0, 1.0],
        [
            1.2382309077616358,
            18.729348944434047,
            18.729348944434047,
            0.0,
            76.21975609966997,
            76.21975609966997,
        ],
    ),
    (
        [3.0, 2.0, 1.0],
        [
            4.6560012697568816,
            9.161970906562738,
            34.21891765849272,
            9.632557631369707,
            35.599830507687976,
            3.9141914749957225,
        ],
    ),
];

#[test]
fn lambs_coefficients() {
    for (semi_axes, exact) in LAMB {
        let m = lamb::added_mass(semi_axes).unwrap();
        for i in 0..6 {
            let (got, exact) = (m[(i, i)], exact[i]);
            assert!(
                (got - exact).abs() <= 1e-14 * exact,
                "{semi_axes:?} {i}: {got} {exact}"
            );
        }
        assert_eq!(m, Mat6::from_diagonal(&m.diagonal()));
    }
}

/// Closed forms of spheroids, series where they cancel.
#[test]
fn lambs_coefficients_at_extreme_ratios() {
    // A thin disc: 8/3 a³ along its axis, 16/45 a⁵ about a diameter, both to first order in c.
    for c in [1e-4, 1e-3] {
        let m = lamb::added_mass([1.0, 1.0, c]).unwrap().diagonal();
        assert!((m[2] / (8.0 / 3.0) - 1.0).abs() < 2.0 * c, "{c}: {m}");
        assert!((m[3] / (16.0 / 45.0) - 1.0).abs() < 2.0 * c, "{c}: {m}");
        assert_eq!(m[5], 0.0);
        // Along the disc, with e = √(1 − c²): α = c (asin e − e c) / e³.
        let e = (1.0 - c * c).sqrt();
        let alpha = c * (e.asin() - e * c) / e.powi(3);
        let exact = 4.0 / 3.0 * PI * c * alpha / (2.0 - alpha);
        assert!((m[0] / exact - 1.0).abs() < 1e-12, "{c}: {m}");
    }
    // A needle: α = 2 c² (atanh e − e)/e³ along it, (with a = 1), slender-body values across.
    for c in [1e-4, 1e-3] {
        let m = lamb::added_mass([c, 1.0, c]).unwrap().diagonal();
        let e = (1.0 - c * c).sqrt();
        let alpha = 2.0 * c * c * (((1.0 + e) / c).ln() - e) / e.powi(3);
        let volume = 4.0 / 3.0 * PI * c * c;
        assert!((m[1] / (volume * alpha / (2.0 - alpha)) - 1.0).abs() < 1e-12);
        assert!((m[0] / volume - 1.0).abs() < 20.0 * c * c);
        assert!((m[3] / (volume / 5.0) - 1.0).abs() < 100.0 * c * c, "{m}");
        assert_eq!(m[4], 0.0);
    }
    // Powers of the size, and of the smallest and largest lengths that are taken.
    for s in [1e-30f64, 1e-3, 1e3, 1e29] {
        let unit = lamb::added_mass([3.0, 2.0, 1.0]).unwrap().diagonal();
        let m = lamb::added_mass([3.0 * s, 2.0 * s, s]).unwrap().diagonal();
        assert!(m.iter().all(|x| x.is_finite() && *x > 0.0), "{s}: {m}");
        if (1e-3..=1e3).contains(&s) {
            for i in 0..6 {
                let power = if i < 3 { 3 } else { 5 };
                assert!((m[i] / (unit[i] * s.powi(power)) - 1.0).abs() < 1e-13);
            }
        }
    }
}

/// About x, with b nearly c, the coefficient goes like (b − c)²: 4/15 · 4π/5 … of a sphere's
/// neighbour, with no digit lost.
#[test]
fn nearly_equal_axes_lose_no_digits() {
    let ratio = |a: f64, d: f64| {
        let (b, c): (f64, f64) = (1.0 + d, 1.0 - d);
        // The difference that rounding left.
        let d = (b - c) / 2.0;
        lamb::added_mass([a, b, c]).unwrap()[(3, 3)] / (d * d)
    };
    for a in [0.1, 1.0, 7.0] {
        let limit = ratio(a, 1e-6);
        for d in [1e-12, 1e-10, 1e-8, -1e-8, 1e-7] {
            assert!((ratio(a, d) / limit - 1.0).abs() < 1e-11, "{a} {d}");
        }
        assert_eq!(lamb::added_mass([a, 1.0, 1.0]).unwrap()[(3, 3)], 0.0);
    }
    // The sphere's neighbour, to leading order: V/5 · 4 d² · g · 4/(4 (2 − 2g)), g = 2/5.
    let sphere = 4.0 / 3.0 * PI / 5.0 * 16.0 * 0.4 / (2.0 - 0.8);
    assert!((ratio(1.0, 1e-6) / sphere - 1.0).abs() < 1e-5);
}

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

const SHAPES: [[f64; 3]; 8] = [
    [1.0, 1.0, 1.0],
    [1.0, 0.2, 1.0],
    [1.0, 0.1, 1.0],
    [1.0, 1.0, 0.03],
    [5.0, 1.0, 5.0],
    [5.0, 1.0, 1.0],
    [3.0, 2.0, 1.0],
    [0.4, 2.0, 1.0],
];

/// The energy of the flow, by Green's theorem on the surface, is ½ νᵀ M ν.
#[test]
fn motion_field_has_the_energy_of_the_added_mass() {
    for semi_axes in SHAPES {
        let body = exact("body", semi_axes, 0.5);
        let points = surface(semi_axes, 60, 80);
        let at: Vec<Vec3> = points.iter().map(|p| p.0).collect();
        let potential = body.radiated(&at).unwrap();
        let mut m = Mat6::zeros();
        for (i, (x, n, area)) in points.iter().enumerate() {
            let moment = x.cross(n);
            let flux = Vec6::new(n.x, n.y, n.z, moment.x, moment.y, moment.z);
            let phi = Vec6::from_fn(|j, _| potential[(i, j)]);
            m += phi * flux.transpose() * *area;
        }
        let error = (m - body.added_mass()).abs().max() / body.added_mass().abs().max();
        assert!(error < 1e-12, "{semi_axes:?}: {error:e}");
    }
}

/// Far away: φ → x · (V u + M u) / (4π |x|³) for density 1.
#[test]
fn motion_field_is_a_dipole_far_away() {
    for semi_axes in SHAPES {
        let body = exact("body", semi_axes, 0.5);
        let volume = 4.0 / 3.0 * PI * semi_axes[0] * semi_axes[1] * semi_axes[2];
        let x = Vec3::new(0.48, -0.6, 0.64) * 1e5;
        let got = body.radiated(&[x]).unwrap();
        for i in 0..3 {
            let dipole = volume + body.added_mass()[(i, i)];
            let expected = dipole * x[i] / (4.0 * PI * x.norm().powi(3));
            let error: f64 = got[(0, i)] / expected - 1.0;
            assert!(error.abs() < 1e-7, "{semi_axes:?} {i}: {error:e}");
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
                let far = off_surface(axes, 0.5 * longest(axes), 3);
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

#[test]
fn sphere_in_motion_is_a_dipole() {
    let body = exact("ball", [0.5; 3], 0.1);
    for x in [
        Vec3::new(0.5, 0.0, 0.0),
        Vec3::new(0.3, -0.7, 1.1),
        Vec3::new(-30.0, 2.0, 100.0),
    ] {
        let got = body.radiated(&[x]).unwrap();
        for i in 0..3 {
            let expected = 0.5f64.powi(3) / 2.0 * x[i] / x.norm().powi(3);
            assert!((got[(0, i)] - expected).abs() <= 1e-14 * expected.abs());
            assert_eq!(got[(0, 3 + i)], 0.0);
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

/// Points at a distance off the ellipsoid, spread over it.
fn off_surface(semi_axes: [f64; 3], gap: f64, count: usize) -> Vec<Vec3> {
    let axes = Vec3::from(semi_axes);
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let turn = 2.399_963 * i as f64;
            let s = (1.0 - z * z).sqrt();
            let unit = Vec3::new(s * turn.cos(), s * turn.sin(), z);
            unit.component_mul(&axes) + unit.component_div(&axes).normalize() * gap
        })
        .collect()
}

fn longest(semi_axes: [f64; 3]) -> f64 {
    semi_axes.iter().fold(0.0, |m, a| a.max(m))
}

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
    for semi_axes in ELLIPSOIDS {
        for gap in [1.0, 0.2, 0.1] {
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
        let sources = off_surface(semi_axes, gap, 7);
        let axes = Vec3::from(semi_axes);
        let step = 1e-3
            * semi_axes
                .iter()
                .fold(f64::INFINITY, |m: f64, a| m.min(*a))
                .powi(2);
        let feet = off_surface(semi_axes, 0.0, 40);
        let weights = [-25.0, 48.0, -36.0, 16.0, -3.0].map(|w| w / 12.0 / step);
        let mut slopes = Vec::new();
        for x in &feet {
            let n = x.component_div(&axes).component_div(&axes).normalize();
            let line: Vec<Vec3> = (0..5).map(|k| x + n * (step * f64::from(k))).collect();
            let own = body.scattered(&sources, &line).unwrap();
            for (j, y) in sources.iter().enumerate() {
                let away = x - y;
                let asked = n.dot(&away) / away.norm().powi(3);
                let slope: f64 = (0..5).map(|k| weights[k] * own[(k, j)]).sum();
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
        let sources = off_surface(semi_axes, gap, 5);
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
    let points = off_surface([1.0; 3], 0.2, 30);
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

/// Axes in any order, in any unit, and sources and points exchanged.
#[test]
fn scattering_is_symmetric_and_knows_no_unit() {
    let axes = [3.0, 2.0, 1.0];
    let body = exact("body", axes, 0.5);
    let sources = off_surface(axes, 0.6, 20);
    let points = off_surface(axes, 1.1, 33);
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
    assert!((other.subrows(0, 20) - same).norm_max() < 1e-13);
    assert_eq!(body.scattered(&[], &points).unwrap().shape(), (33, 0));
    assert_eq!(body.scattered(&points, &[]).unwrap().shape(), (0, 33));
}

/// Between the resolved gap and half of it answers fade; far below they are refused.
#[test]
fn points_too_near_are_refused() {
    let axes = [1.0, 0.2, 1.0];
    let fine = exact("coin", axes, 0.05);
    let body = exact("coin", axes, 0.4);
    for (gap, limit) in [(0.4, 1e-9), (0.2, 1e-4)] {
        let points = off_surface(axes, gap, 50);
        let (got, exact) = (
            body.scattered(&points, &points).unwrap(),
            fine.scattered(&points, &points).unwrap(),
        );
        let error = (&got - &exact).norm_max() / exact.norm_max();
        assert!(error < limit, "{gap}: {error:e}");
    }
    let points = off_surface(axes, 0.02, 50);
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
        let mesh =
            BodyBoundary::new("body", mesh.vertices(), mesh.faces(), &Settings::default()).unwrap();
        let body = exact("body", semi_axes, 0.3);
        let points = off_surface(semi_axes, 0.4, 40);
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
        let text = lamb::added_mass([bad, 1.0, 1.0]).unwrap_err().to_string();
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
