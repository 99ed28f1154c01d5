//! The scalar formulas against dual numbers and known values; the sums against the scalar formulas.

use super::double::Double;
use super::flux::value_of_corners;
use super::lane::Lane;
use super::normal::Normal;
use super::panel::{Layer, Panel};
use super::point::PointKernel;
use super::potential::Potential;
use super::single::Single;
use super::*;
use crate::check::{dot, dot_product_gap};
use crate::lie::Vec3;
use crate::sample::Samples;
use num_dual::{DualNum, HyperDual64};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Numbers in a vector: 1, 4, or 0 for what the processor has.
pub(super) static VECTORS: AtomicUsize = AtomicUsize::new(0);
/// Held by the test that changes [`VECTORS`] and by those that compare bits.
static WIDTHS: Mutex<()> = Mutex::new(());

impl Lane for HyperDual64 {
    fn like(self, value: f64) -> Self {
        Self::from(value)
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        c - self * b
    }
    fn sqrt(self) -> Self {
        DualNum::sqrt(&self)
    }
    fn artanh(self) -> Self {
        DualNum::atanh(&self)
    }
    fn atan2(self, x: Self) -> Self {
        DualNum::atan2(&self, x)
    }
    fn clamp_unit(self) -> Self {
        match self.re {
            x if x <= 0.0 => Self::from(0.0),
            x if x >= 1.0 => Self::from(1.0),
            _ => self,
        }
    }
    fn at_least(self, bound: f64) -> Self {
        if self.re < bound {
            Self::from(bound)
        } else {
            self
        }
    }
    fn any_below(self, bound: f64) -> bool {
        self.re < bound
    }
}

/// A vector of numbers between −1 and 1.
fn vector(random: &mut Samples) -> Vec3 {
    Vec3::from(random.array())
}

/// Gradient and Hessian times `d` of `f` at `s`, by hyper-dual numbers.
fn derivatives(f: impl Fn([HyperDual64; 3]) -> HyperDual64, s: &Vec3, d: &Vec3) -> (Vec3, Vec3) {
    let (mut gradient, mut product) = (Vec3::zeros(), Vec3::zeros());
    for c in 0..3 {
        let mut x = [0, 1, 2].map(|i| HyperDual64::new(s[i], 0.0, d[i], 0.0));
        x[c].eps1 = 1.0;
        let y = f(x);
        gradient[c] = y.eps1;
        product[c] = y.eps1eps2;
    }
    (gradient, product)
}

fn close(a: &Vec3, b: &Vec3) {
    assert!((a - b).norm() < 1e-12 * b.norm(), "{a} {b}");
}

#[test]
fn gradients_and_hessians_agree_with_dual_numbers() {
    let mut random = Samples::new(1);
    for _ in 0..50 {
        let corners = [
            vector(&mut random),
            vector(&mut random),
            vector(&mut random),
        ];
        let (s, d) = (vector(&mut random) * 2.0, vector(&mut random));
        let w = 1.7;
        let (g, h) = derivatives(|s| value_of_corners(&corners, s) * w, &s, &d);
        // The value's numerator and denominator cancel near the edges, the edge terms do not.
        let size = g.norm().max(1e-3);
        assert!((flux_gradient(&corners, w, &s) - g).norm() < 1e-9 * size);
        assert!((flux_hessian_product(&corners, w, &s, &d) - h).norm() < 1e-8 * h.norm().max(1e-3));

        let (g, h) = derivatives(|s| Single::near(&Panel::new(corners, w), s), &s, &d);
        assert!((single_gradient(&corners, w, &s) - g).norm() < 1e-11 * g.norm());
        assert!((single_hessian_product(&corners, w, &s, &d) - h).norm() < 1e-9 * h.norm());

        let (x, n) = (vector(&mut random), vector(&mut random).normalize());
        let lanes = |v: &Vec3, s: [HyperDual64; 3]| [0, 1, 2].map(|c| s[c].like(v[c]));
        let r = |s| lane::sub(lanes(&x, s), s);
        let (g, h) = derivatives(|s| Normal::value_of(lanes(&(w * n), s), r(s)), &s, &d);
        close(&normal_gradient(&x, &n, w, &s), &g);
        close(&normal_hessian_product(&x, &n, w, &s, &d), &h);
        let (g, h) = derivatives(|s| Potential::value_of(r(s), r(s)), &s, &d);
        close(&potential_gradient(&x, &s), &g);
        close(&potential_hessian_product(&x, &s, &d), &h);
    }
}

/// A triangle with its circumscribed radius about the centroid.
fn triangle(random: &mut Samples) -> (Panel, Vec3, f64) {
    let corners = [(); 3].map(|()| vector(random));
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    let radius = corners
        .map(|v| (v - centre).norm())
        .into_iter()
        .fold(0.0, f64::max);
    (Panel::new(corners, 1.7), centre, radius)
}

fn layer_agrees_with_dual_numbers<L: Layer>() {
    let mut random = Samples::new(4);
    let mut worst = [0.0_f64; 2];
    for n in 0..400 {
        let (panel, centre, radius) = triangle(&mut random);
        // Within, between and beyond the two reaches.
        let away = (3.0 + 0.02 * n as f64) * radius;
        let (s, d) = (
            centre + away * vector(&mut random).normalize(),
            vector(&mut random),
        );
        let lanes = |v: &Vec3| [v.x, v.y, v.z];
        let (g, h) = derivatives(|s| panel.value::<L, _>(s), &s, &d);
        let gradient = Vec3::from(panel.gradient::<L, _>(lanes(&s)));
        let product = Vec3::from(panel.hessian_product::<L, _>(lanes(&s), lanes(&d)));
        worst[0] = worst[0].max((gradient - g).norm() / g.norm());
        worst[1] = worst[1].max((product - h).norm() / h.norm());
    }
    println!("gradient {:e}, Hessian {:e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-11 && worst[1] < 1e-9, "{worst:?}");
}

#[test]
fn blended_layers_agree_with_dual_numbers() {
    layer_agrees_with_dual_numbers::<Single>();
    layer_agrees_with_dual_numbers::<Double>();
}

/// The multipoles against the closed form where they set in, relative to the largest that a layer has at the distance.
fn far_error<L: Layer>(size: impl Fn(f64, f64) -> f64) -> f64 {
    let mut random = Samples::new(6);
    let mut worst = 0.0_f64;
    for _ in 0..2000 {
        let (panel, centre, radius) = triangle(&mut random);
        let away = panel::NEAR * radius;
        let s = centre + away * vector(&mut random).normalize();
        let s = [s.x, s.y, s.z];
        let far = panel.far_value::<L>(s);
        let area = 0.5 * panel.double_area.norm();
        worst = worst.max((far - L::near(&panel, s)).abs() / (1.7 * area * size(away, radius)));
    }
    worst
}

#[test]
fn multipoles_are_near_the_closed_form() {
    let single = far_error::<Single>(|r, _| 1.0 / r);
    let double = far_error::<Double>(|r, _| 1.0 / (r * r));
    println!("single {single:e}, double {double:e}");
    assert!(single < 6e-4 && double < 2e-3, "{single:e} {double:e}");
}

/// Values in 60-digit arithmetic: before, far behind, and close to the triangle on either side.
#[test]
fn solid_angle_has_known_values() {
    let corners = [
        Vec3::new(1.0, 0.125, 0.0),
        Vec3::new(0.0, 1.25, 0.125),
        Vec3::new(0.0, 0.0, 0.75),
    ];
    let triangle = Triangles::new(&corners, &[[0, 1, 2]], vec![1.0]);
    let cases = [
        ([0.0, 0.0, 0.0], 1.358_439_546_128_031_4),
        ([0.25, 0.375, 0.25], 4.902_091_209_923_049),
        ([0.3125, 0.4375, 0.25], 5.619_799_797_493_395),
        ([0.328125, 0.453125, 0.28125], 6.116_414_842_863_337),
        ([0.375, 0.5, 0.375], -4.980_397_704_413_438),
        ([-3000.0, 1000.0, -2000.0], 4.250_397_567_265_105_5e-8),
        ([-1.0e6, 2.0e5, -3.0e5], 4.617_753_023_372_099e-13),
    ];
    for (s, value) in cases {
        let s = Vec3::from(s);
        let mut sum = [0.0];
        flux_fill(&triangle, &Sources::new(&[s]), Write::Set, &mut sum, 1, 0);
        let (scalar, sum) = (flux(&corners, 1.0, &s) / value - 1.0, sum[0] / value - 1.0);
        println!("{s:?} {scalar:e} {sum:e}");
        assert!(scalar.abs() < 2e-15 && sum.abs() < 2e-15);
    }
}

/// A ball of `n` bands, its vertices shaken, size `r`; faces outward, 4 n² of them less the poles'.
fn ball(n: usize, r: f64) -> Triangles {
    let mut random = Samples::new(7);
    let m = 2 * n;
    let angle = std::f64::consts::PI / n as f64;
    let mut vertices = vec![Vec3::z() * r];
    for i in 1..n {
        for j in 0..m {
            let (t, p) = (angle * i as f64, angle * j as f64);
            let x = Vec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
            vertices.push(r * (x + 0.05 * angle * vector(&mut random)));
        }
    }
    vertices.push(-Vec3::z() * r);
    let last = vertices.len() - 1;
    let at = |i: usize, j: usize| match i {
        0 => 0,
        i if i == n => last,
        i => 1 + (i - 1) * m + j % m,
    };
    let mut faces = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
            if c != d {
                faces.push([a, c, d]);
            }
            if a != b {
                faces.push([a, d, b]);
            }
        }
    }
    let weights = (0..faces.len()).map(|i| 1.0 + (i % 5) as f64).collect();
    Triangles::new(&vertices, &faces, weights)
}

fn points_of(t: &Triangles) -> Points {
    let centres: Vec<Vec3> = (0..t.len()).map(|i| t.centroid(i)).collect();
    let normals: Vec<Vec3> = (0..t.len()).map(|i| t.normal(i)).collect();
    Points::new(&centres, &normals, t.weights().to_vec())
}

/// `count` sources well inside, with displacements.
fn inside(count: usize, r: f64) -> (Sources, Vec<Vec3>) {
    let mut random = Samples::new(11);
    let sources = (0..count).map(|_| 0.45 * r * vector(&mut random)).collect();
    (
        sources,
        (0..count).map(|_| r * vector(&mut random)).collect(),
    )
}

#[test]
fn solid_angles_of_a_closed_surface_add_up() {
    let t = ball(9, 1.0);
    assert!(t.sides.iter().all(|s| s.right != target::NONE));
    assert_eq!(2 * t.sides.len(), 3 * t.len());
    let (s, _) = inside(21, 1.0);
    let mut matrix = vec![0.0; t.len() * 21];
    flux_fill(&t, &s, Write::Set, &mut matrix, 21, 0);
    for j in 0..21 {
        let total: f64 = (0..t.len())
            .map(|i| matrix[i * 21 + j] / t.weights()[i])
            .sum();
        assert!(
            (total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-14,
            "{total}"
        );
    }
    // A constant row cotangent of a closed surface sees no gradient at all.
    let bar: Vec<f64> = t.weights().iter().map(|w| 1.0 / w).collect();
    let mut gradient = vec![0.0; 21 * 3];
    flux_vjp(&t, &s, &bar, 1, &mut gradient);
    assert!(gradient.iter().all(|g| g.abs() < 1e-13));
}

/// Relative distance of a sum from its plain double loop.
fn gap(sum: &[f64], plain: &[f64]) -> f64 {
    let difference: Vec<f64> = sum.iter().zip(plain).map(|(a, b)| a - b).collect();
    crate::check::norm(&difference) / crate::check::norm(plain)
}

/// All sums of one size against double loops over the scalar functions; the largest gap.
fn sums_against_scalars(bands: usize, count: usize, k: usize, size: f64) -> f64 {
    let t = ball(bands, size);
    let p = points_of(&t);
    let (s, d) = inside(count, size);
    let n = t.len();
    let mut random = Samples::new(3);
    let (bar, a) = (random.numbers(n * k, 1.0), random.numbers(count * k, 1.0));
    let mut worst: f64 = 0.0;

    // Fill a block in the middle of a larger array, then add.
    let (stride, column) = (count + 5, 3);
    let value = |i: usize, j: usize| flux(&t.corners(i), t.weights()[i], &s.point(j));
    let normal_value = |i: usize, j: usize| {
        normal(
            &p.centres()[i],
            &p.normals()[i],
            p.weights()[i],
            &s.point(j),
        )
    };
    for flux_kernel in [true, false] {
        let mut block = vec![0.5; n * stride];
        for write in [Write::Set, Write::Add] {
            if flux_kernel {
                flux_fill(&t, &s, write, &mut block, stride, column);
            } else {
                normal_fill(&p, &s, write, &mut block, stride, column);
            }
        }
        let (mut plain, mut seen) = (Vec::new(), Vec::new());
        for (at, entry) in block.iter().enumerate() {
            let (i, j) = (at / stride, at % stride);
            if (column..column + count).contains(&j) {
                let f = if flux_kernel {
                    value(i, j - column)
                } else {
                    normal_value(i, j - column)
                };
                plain.push(2.0 * f);
                seen.push(*entry);
            } else {
                assert_eq!(*entry, 0.5, "written outside of the block");
            }
        }
        worst = worst.max(gap(&seen, &plain));
    }

    // Sums over targets; they add to what is there.
    type Gradient<'a> = &'a dyn Fn(usize, usize) -> Vec3;
    let transposed = |sum: &dyn Fn(&mut [f64]), g: Gradient| {
        let mut out = vec![0.0; count * k * 3];
        sum(&mut out);
        sum(&mut out);
        let mut plain = vec![0.0; out.len()];
        for (i, j) in (0..n).flat_map(|i| (0..count).map(move |j| (i, j))) {
            let g = g(i, j);
            for (m, x) in plain[j * k * 3..][..k * 3].iter_mut().enumerate() {
                *x += 2.0 * bar[i * k + m / 3] * g[m % 3];
            }
        }
        gap(&out, &plain)
    };
    let (x, nn, w) = (p.centres(), p.normals(), p.weights());
    let flux_g = |i: usize, j: usize| flux_gradient(&t.corners(i), w[i], &s.point(j));
    let normal_g = |i: usize, j: usize| normal_gradient(&x[i], &nn[i], w[i], &s.point(j));
    worst = worst.max(transposed(&|o| flux_vjp(&t, &s, &bar, k, o), &flux_g));
    let at = |j: usize| [s.x[j], s.y[j], s.z[j]];
    let along = |j: usize| [d[j].x, d[j].y, d[j].z];
    let single_g = |i: usize, j: usize| t.panels[i].gradient::<Single, _>(at(j)).into();
    let double_g = |i: usize, j: usize| t.panels[i].gradient::<Double, _>(at(j)).into();
    worst = worst.max(transposed(&|o| normal_vjp(&p, &s, &bar, k, o), &normal_g));
    worst = worst.max(transposed(&|o| single_vjp(&t, &s, &bar, k, o), &single_g));
    worst = worst.max(transposed(
        &|o| single_hvp(&t, &s, &d, &bar, k, o),
        &|i, j| (t.panels[i].hessian_product::<Single, _>(at(j), along(j))).into(),
    ));
    worst = worst.max(transposed(&|o| double_vjp(&t, &s, &bar, k, o), &double_g));
    worst = worst.max(transposed(
        &|o| double_hvp(&t, &s, &d, &bar, k, o),
        &|i, j| (t.panels[i].hessian_product::<Double, _>(at(j), along(j))).into(),
    ));
    let (mut filled, mut plain) = (vec![0.0; n * count], Vec::new());
    double_fill(&t, &s, Write::Add, &mut filled, count, 0);
    for (i, j) in (0..n).flat_map(|i| (0..count).map(move |j| (i, j))) {
        plain.push(t.panels[i].value::<Double, f64>(at(j)));
    }
    worst = worst.max(gap(&filled, &plain));
    worst = worst.max(transposed(
        &|o| potential_vjp(&p, &s, &bar, k, o),
        &|i, j| potential_gradient(&x[i], &s.point(j)),
    ));
    worst = worst.max(transposed(
        &|o| flux_hvp(&t, &s, &d, &bar, k, o),
        &|i, j| flux_hessian_product(&t.corners(i), w[i], &s.point(j), &d[j]),
    ));
    worst = worst.max(transposed(
        &|o| normal_hvp(&p, &s, &d, &bar, k, o),
        &|i, j| normal_hessian_product(&x[i], &nn[i], w[i], &s.point(j), &d[j]),
    ));
    worst = worst.max(transposed(
        &|o| potential_hvp(&p, &s, &d, &bar, k, o),
        &|i, j| potential_hessian_product(&x[i], &s.point(j), &d[j]),
    ));
    let (mut out, mut plain) = (vec![0.0; count * k], vec![0.0; count * k]);
    potential_sum(&p, &s, &bar, k, &mut out);
    for (i, m) in (0..n).flat_map(|i| (0..count * k).map(move |m| (i, m))) {
        plain[m] += bar[i * k + m % k] * potential(&x[i], &s.point(m / k));
    }
    worst = worst.max(gap(&out, &plain));
    let (mut out, mut plain) = (vec![0.0; count * k], vec![0.0; count * k]);
    single_sum(&t, &s, &bar, k, &mut out);
    for (i, m) in (0..n).flat_map(|i| (0..count * k).map(move |m| (i, m))) {
        plain[m] += bar[i * k + m % k] * t.panels[i].value::<Single, f64>(at(m / k));
    }
    worst = worst.max(gap(&out, &plain));

    // Sums over sources.
    let forward = |sum: &dyn Fn(&mut [f64]), g: Gradient| {
        let mut out = vec![0.0; n * k];
        sum(&mut out);
        sum(&mut out);
        let mut plain = vec![0.0; n * k];
        for (i, j) in (0..n).flat_map(|i| (0..count).map(move |j| (i, j))) {
            let slope = 2.0 * g(i, j).dot(&d[j]);
            for m in 0..k {
                plain[i * k + m] += slope * a[j * k + m];
            }
        }
        gap(&out, &plain)
    };
    worst = worst.max(forward(&|o| flux_jvp(&t, &s, &d, &a, k, o), &flux_g));
    worst = worst.max(forward(&|o| single_jvp(&t, &s, &d, &a, k, o), &single_g));
    worst = worst.max(forward(&|o| double_jvp(&t, &s, &d, &a, k, o), &double_g));
    worst = worst.max(forward(&|o| normal_jvp(&p, &s, &d, &a, k, o), &normal_g));

    // With all corners a panel moves as the point moves against it.
    let mut sums = vec![CornerSums::default(); n * k];
    corner_vjp(&t, &s, Form::Blended, &a, k, &mut sums);
    let (mut found, mut plain) = (Vec::new(), vec![0.0; 6 * n * k]);
    for sum in &sums {
        for corners in [&sum.single_corners, &sum.double_corners] {
            let all = corners[0] + corners[1] + corners[2];
            found.extend([-all.x, -all.y, -all.z]);
        }
    }
    for (i, j) in (0..n).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let g = [single_g(i, j), double_g(i, j)];
        for m in 0..6 * k {
            plain[6 * i * k + m] += a[j * k + m / 6] * g[m / 3 % 2][m % 3];
        }
    }
    worst.max(gap(&found, &plain))
}

/// A point close above a panel, in one vector with some that are far from it: as by itself.
#[test]
fn near_points_keep_their_digits_beside_far_ones() {
    let _widths = WIDTHS.lock().unwrap_or_else(|e| e.into_inner());
    let t = ball(5, 1.0);
    let corners = t.corners(0);
    let normal = (corners[1] - corners[0])
        .cross(&(corners[2] - corners[0]))
        .normalize();
    let edge = (corners[1] - corners[0]).norm();
    let d = vec![Vec3::new(0.3, -0.5, 0.8); 8];
    let mut bar = vec![0.0; t.len()];
    bar[0] = 1.0;
    for height in [1e-2, 1e-4, 1e-6, 0.0] {
        let centre = corners.iter().sum::<Vec3>() / 3.0;
        let mut points = vec![centre + height * edge * normal];
        points.extend((1..8).map(|k| Vec3::new(40.0 * edge, f64::from(k), 3.0)));
        let s = Sources::new(&points);
        let at = [points[0].x, points[0].y, points[0].z];
        let along = [d[0].x, d[0].y, d[0].z];
        let panel = &t.panels[0];
        let alone: [[f64; 3]; 4] = [
            panel.gradient::<Single, _>(at),
            panel.hessian_product::<Single, _>(at, along),
            panel.gradient::<Double, _>(at),
            panel.hessian_product::<Double, _>(at, along),
        ];
        for width in [4, 0] {
            VECTORS.store(width, Relaxed);
            let mut sums = [0; 4].map(|_| vec![0.0; 24]);
            single_vjp(&t, &s, &bar, 1, &mut sums[0]);
            single_hvp(&t, &s, &d, &bar, 1, &mut sums[1]);
            double_vjp(&t, &s, &bar, 1, &mut sums[2]);
            double_hvp(&t, &s, &d, &bar, 1, &mut sums[3]);
            VECTORS.store(0, Relaxed);
            for (k, (sum, alone)) in sums.iter().zip(&alone).enumerate() {
                let off = gap(&sum[..3], alone);
                assert!(off < 1e-12, "{k} at {height} on {width}: {off:e}");
            }
        }
    }
}

#[test]
fn sums_agree_with_scalar_loops_on_every_vector_width() {
    let _widths = WIDTHS.lock().unwrap_or_else(|e| e.into_inner());
    let mut worst: f64 = 0.0;
    for width in [1, 4, 0] {
        VECTORS.store(width, Relaxed);
        for (bands, count, k) in [(2, 1, 1), (5, 7, 2), (9, 40, 5), (7, 83, 11), (6, 33, 20)] {
            worst = worst.max(sums_against_scalars(bands, count, k, 1.0));
        }
        // A millimetre and a kilometre.
        worst = worst.max(sums_against_scalars(5, 13, 3, 1e-3));
        worst = worst.max(sums_against_scalars(5, 13, 3, 1e3));
    }
    VECTORS.store(0, Relaxed);
    println!("largest relative difference {worst:e}");
    assert!(worst < 1e-13, "{worst:e}");
}

#[test]
fn empty_sums_do_nothing() {
    let t = ball(3, 1.0);
    let none = Sources::new(&[]);
    flux_fill(&t, &none, Write::Set, &mut [], 0, 0);
    flux_vjp(&t, &none, &vec![1.0; t.len()], 1, &mut []);
    let mut rows = vec![0.0; t.len()];
    flux_jvp(&t, &none, &[], &[], 1, &mut rows);
    flux_jvp(&t, &none, &[], &[], 0, &mut []);
    assert!(rows.iter().all(|r| *r == 0.0));
    let (s, d) = inside(3, 1.0);
    let empty = Triangles::new(&[], &[], vec![]);
    let mut out = vec![0.0; 9];
    flux_hvp(&empty, &s, &d, &[], 1, &mut out);
    normal_vjp(&Points::default(), &s, &[], 1, &mut out);
    assert!(out.iter().all(|r| *r == 0.0));
}

/// Everything computed for one case, in one array.
fn everything() -> Vec<f64> {
    let (t, k, count) = (ball(12, 1.0), 3, 101);
    let p = points_of(&t);
    let (s, d) = inside(count, 1.0);
    let mut random = Samples::new(5);
    let (bar, a) = (
        random.numbers(t.len() * k, 1.0),
        random.numbers(count * k, 1.0),
    );
    let mut all = Vec::new();
    let mut add = |len: usize, f: &dyn Fn(&mut [f64])| {
        let start = all.len();
        all.resize(start + len, 0.0);
        f(&mut all[start..]);
    };
    let (rows, vectors) = (t.len() * k, count * k * 3);
    add(t.len() * count, &|o| {
        flux_fill(&t, &s, Write::Set, o, count, 0)
    });
    add(t.len() * count, &|o| {
        normal_fill(&p, &s, Write::Add, o, count, 0)
    });
    add(rows, &|o| flux_jvp(&t, &s, &d, &a, k, o));
    add(rows, &|o| normal_jvp(&p, &s, &d, &a, k, o));
    add(vectors, &|o| flux_vjp(&t, &s, &bar, k, o));
    add(vectors, &|o| normal_vjp(&p, &s, &bar, k, o));
    add(t.len() * count, &|o| {
        double_fill(&t, &s, Write::Add, o, count, 0)
    });
    add(rows, &|o| double_jvp(&t, &s, &d, &a, k, o));
    add(vectors, &|o| double_vjp(&t, &s, &bar, k, o));
    add(vectors, &|o| double_hvp(&t, &s, &d, &bar, k, o));
    add(rows, &|o| single_jvp(&t, &s, &d, &a, k, o));
    add(vectors, &|o| single_vjp(&t, &s, &bar, k, o));
    add(vectors, &|o| single_hvp(&t, &s, &d, &bar, k, o));
    add(count * k, &|o| single_sum(&t, &s, &bar, k, o));
    add(vectors, &|o| potential_vjp(&p, &s, &bar, k, o));
    add(vectors, &|o| flux_hvp(&t, &s, &d, &bar, k, o));
    add(vectors, &|o| normal_hvp(&p, &s, &d, &bar, k, o));
    add(vectors, &|o| potential_hvp(&p, &s, &d, &bar, k, o));
    add(rows, &|o| potential_jvp(&p, &s, &d, &a, k, o));
    add(p.len() * count, &|o| {
        potential_fill(&p, &s, Write::Add, o, count, 0)
    });
    add(count * k, &|o| potential_sum(&p, &s, &bar, k, o));
    let mut sums = vec![CornerSums::default(); t.len() * k];
    for form in [Form::Closed, Form::Blended] {
        corner_vjp(&t, &s, form, &a, k, &mut sums);
        corner_hvp(&t, &s, form, &d, &a, k, &mut sums);
    }
    for sum in &sums {
        let corners = sum.single_corners.iter().chain(&sum.double_corners);
        all.extend(corners.flat_map(|v| [v.x, v.y, v.z]));
        all.push(sum.single);
    }
    all
}

#[test]
fn threads_do_not_change_a_bit() {
    let _widths = WIDTHS.lock().unwrap_or_else(|e| e.into_inner());
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(everything)
    };
    let one = run(1);
    assert!(one.iter().all(|x| x.is_finite()));
    for threads in [2, 3] {
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert!(bits(&one) == bits(&run(threads)));
    }
}

#[test]
fn forward_and_transposed_sums_are_transposes_and_hessians_symmetric() {
    let (t, k, count) = (ball(6, 1.0), 4, 29);
    let p = points_of(&t);
    let (s, d) = inside(count, 1.0);
    let mut random = Samples::new(9);
    let (bar, a) = (
        random.numbers(t.len() * k, 1.0),
        random.numbers(count * k, 1.0),
    );
    let other: Vec<Vec3> = (0..count).map(|_| vector(&mut random)).collect();
    // Σ_k a[j][k] g[j][k], then flat coordinates.
    let contract = |g: &[f64]| -> Vec<f64> {
        let at = |j: usize, c: usize| (0..k).map(|m| a[j * k + m] * g[(j * k + m) * 3 + c]).sum();
        (0..count * 3).map(|n| at(n / 3, n % 3)).collect()
    };
    let flat = |d: &[Vec3]| d.iter().flat_map(|d| [d.x, d.y, d.z]).collect::<Vec<_>>();
    type Forward<'a> = &'a dyn Fn(&mut [f64]);
    type Tangent<'a> = &'a dyn Fn(&[Vec3], &mut [f64]);
    let check = |jvp: Option<Forward>, vjp: Forward, hvp: Tangent| {
        let mut gradient = vec![0.0; count * k * 3];
        vjp(&mut gradient);
        if let Some(jvp) = jvp {
            let mut rows = vec![0.0; t.len() * k];
            jvp(&mut rows);
            assert!(dot_product_gap(&rows, &bar, &flat(&d), &contract(&gradient)) < 1e-14);
        }
        let (mut h1, mut h2) = (gradient.clone(), gradient);
        h1.fill(0.0);
        h2.fill(0.0);
        hvp(&d, &mut h1);
        hvp(&other, &mut h2);
        let (x, y) = (
            dot(&contract(&h1), &flat(&other)),
            dot(&contract(&h2), &flat(&d)),
        );
        assert!((x / y - 1.0).abs() < 1e-12, "{x} {y}");
    };
    check(
        Some(&|o| flux_jvp(&t, &s, &d, &a, k, o)),
        &|o| flux_vjp(&t, &s, &bar, k, o),
        &|d, o| flux_hvp(&t, &s, d, &bar, k, o),
    );
    check(
        Some(&|o| normal_jvp(&p, &s, &d, &a, k, o)),
        &|o| normal_vjp(&p, &s, &bar, k, o),
        &|d, o| normal_hvp(&p, &s, d, &bar, k, o),
    );
    check(
        Some(&|o| double_jvp(&t, &s, &d, &a, k, o)),
        &|o| double_vjp(&t, &s, &bar, k, o),
        &|d, o| double_hvp(&t, &s, d, &bar, k, o),
    );
    check(
        Some(&|o| single_jvp(&t, &s, &d, &a, k, o)),
        &|o| single_vjp(&t, &s, &bar, k, o),
        &|d, o| single_hvp(&t, &s, d, &bar, k, o),
    );
    check(None, &|o| potential_vjp(&p, &s, &bar, k, o), &|d, o| {
        potential_hvp(&p, &s, d, &bar, k, o)
    });
}

/// Against the potential of the triangle's points, and the value known for a square seen from above its centre.
#[test]
fn the_single_layer_has_known_values() {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let at = |k: usize| Vec3::new(square[k][0], square[k][1], 0.0);
    for height in [0.0, 1e-6, 0.3, 4.0, 300.0] {
        let s = Vec3::new(0.5, 0.5, height);
        let found: f64 = [[0, 1, 2], [0, 2, 3]]
            .map(|f| single(&f.map(at), 1.0, &s))
            .iter()
            .sum();
        // ∫ 1/r over the square, by quarters.
        let root = (0.5_f64 + height * height).sqrt();
        let log = 4.0 * ((root + 0.5) / (root - 0.5)).ln() * 0.5;
        let angle = 4.0 * (0.25_f64).atan2(height * root);
        let exact = log - height * angle;
        assert!(
            (found / exact - 1.0).abs() < 1e-11,
            "{height}: {found} {exact}"
        );
    }
}
