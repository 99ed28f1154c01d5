//! Added mass and flow of an ellipsoid in motion.

use super::{exact, surface};
use crate::support::reference::ellipsoids;
use hydrograd::adjoint::lie::{Mat6, Vec3, Vec6};
use hydrograd::boundary::Response;
use hydrograd::boundary::exact::lamb;
use std::f64::consts::PI;

#[test]
fn lambs_coefficients() {
    for (semi_axes, exact) in ellipsoids() {
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
