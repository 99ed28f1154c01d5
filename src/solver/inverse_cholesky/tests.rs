use super::*;
use crate::adjoint::sample::Samples;
use crate::solver::cgls;
use std::f64::consts::PI;

/// Points on the unit sphere, even to a few percent.
fn spiral(n: usize) -> Vec<Vec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    let at = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / n as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    };
    (0..n).map(at).collect()
}

/// 1/(4π √(r² + ε²)), ε half the points' distance.
fn dirichlet(points: &[Vec3]) -> impl Fn(usize, usize) -> f64 + Sync {
    let epsilon = 0.5 * (4.0 * PI / points.len() as f64).sqrt();
    move |i, j| {
        let square = (points[i] - points[j]).norm_squared() + epsilon * epsilon;
        1.0 / (4.0 * PI * square.sqrt())
    }
}

fn factor(points: &[Vec3], rho: f64) -> InverseCholesky {
    let theta = dirichlet(points);
    InverseCholesky::new(points, rho, |among| {
        Mat::from_fn(among.len(), among.len(), |a, b| theta(among[a], among[b]))
    })
}

fn random(rows: usize, columns: usize, seed: u64) -> Columns {
    let mut numbers = Samples::new(seed);
    let data = (0..rows * columns).map(|_| numbers.number()).collect();
    Columns {
        rows,
        columns,
        data,
    }
}

fn dense(l: &InverseCholesky, n: usize) -> Mat<f64> {
    let mut out = Mat::zeros(n, n);
    for i in 0..n {
        for (j, value) in l.rows().row(i) {
            out[(i, *j)] = *value;
        }
    }
    out
}

#[test]
fn without_a_limit_it_is_the_inverse() {
    let points = spiral(60);
    let theta = dirichlet(&points);
    let l = dense(&factor(&points, 1e3), 60);
    let theta = Mat::from_fn(60, 60, theta);
    let off = l.transpose() * &theta * &l - Mat::<f64>::identity(60, 60);
    assert!(off.norm_max() < 1e-10, "{:e}", off.norm_max());
}

/// Of every column: diag(Lᵀ Θ L) = 1, and no other values on its pattern have a larger likelihood, which is so where Θ_ss L_si is a multiple of e.
#[test]
fn every_column_is_the_best_on_its_pattern() {
    let points = spiral(200);
    let theta = dirichlet(&points);
    let l = factor(&points, 2.0);
    for column in 0..200 {
        let entries = l.transposed().row(column);
        let image = |i: usize| entries.iter().map(|(j, x)| theta(i, *j) * x).sum::<f64>();
        let own = entries.iter().find(|(j, _)| *j == column).unwrap().1;
        for (i, _) in entries {
            let expected = if *i == column { 1.0 / own } else { 0.0 };
            assert!((image(*i) - expected).abs() < 1e-9, "{column} {i}");
        }
    }
}

#[test]
fn transposes_are_each_others() {
    let points = spiral(300);
    let l = factor(&points, 2.0);
    let (x, y) = (random(300, 3, 3), random(300, 3, 4));
    let (a, b) = (l.apply(&x).dots(&y), l.apply_transpose(&y).dots(&x));
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-11 * a.abs().max(1.0), "{a} {b}");
    }
    assert_eq!(l.rows().entries(), l.transposed().entries());
}

/// The original reports 7 to 9 iterations.
#[test]
fn few_iterations_with_the_dirichlet_kernel() {
    let n = 10_000;
    let points = spiral(n);
    let theta = dirichlet(&points);
    let l = factor(&points, 5.5);
    let g = random(n, 1, 7);
    let product = |x: &Columns| {
        let row = |i: usize| (0..n).map(|j| theta(i, j) * x.data[j]).sum();
        Columns {
            rows: n,
            columns: 1,
            data: (0..n).into_par_iter().map(row).collect(),
        }
    };
    let outcome = cgls(
        product,
        |x| *x = l.apply(x),
        |x| *x = l.apply_transpose(x),
        &g,
        1e-4,
        50,
    );
    println!(
        "{} iterations, {:.0} entries a column",
        outcome.iterations,
        l.rows().entries() as f64 / n as f64
    );
    assert!(outcome.iterations <= 12, "{}", outcome.iterations);
    assert!(outcome.residual <= 1e-4);
}

#[test]
fn any_points_give_numbers() {
    let one = [Vec3::zeros()];
    let alone = dense(&factor(&one, 1.0), 1)[(0, 0)];
    assert!((alone * alone * dirichlet(&one)(0, 0) - 1.0).abs() < 1e-14);
    assert_eq!(factor(&[], 1.0).rows().len(), 0);
    // Twins, and points on a line far apart in size.
    let mut points = spiral(50);
    points.extend_from_slice(&spiral(50)[..20]);
    points.extend((0..30).map(|k| Vec3::new(1e-6 * 3f64.powi(k), 0.0, 0.0)));
    let l = factor(&points, 3.0);
    let g = l.apply(&Columns::from_fn(100, 1, |i, _| i as f64));
    assert!(g.data.iter().all(|x| x.is_finite()));
}
