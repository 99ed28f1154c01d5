//! The rungs of the kernels and their checks.

use super::{
    CornerSums, Form, Points, Sources, Triangles, Write, corner_hvp, corner_vjp, double_fill,
    double_hvp, double_jvp, double_vjp, flux, flux_fill, flux_hvp, flux_jvp, flux_vjp, layers_vjp,
    normal_fill, normal_hvp, normal_jvp, normal_vjp, potential_fill, potential_hvp, potential_jvp,
    potential_vjp, single, single_hvp, single_jvp, single_sum, single_vjp,
};
use crate::check::{Outcome, Rung, outcome};
use crate::draw::numbers;
use crate::lie::Vec3;

/// Columns of the checks.
const K: usize = 2;
/// Sources of the checks.
const N: usize = 11;
/// Largest accepted relative error.
const TOLERANCE: f64 = 1e-6;

/// Every derivative rung of the kernels.
pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "kernel::flux::flux_jvp" => |c| forward(flux_matrix, |d, a, out| flux_jvp(&surface(), &sources(&start()), d, a, K, out), c),
        "kernel::flux::flux_vjp" => |c| gradient(flux_matrix, |bar, out| flux_vjp(&surface(), &sources(&start()), bar, K, out), c),
        "kernel::flux::flux_hvp" => |c| tangent(points().len(),
            |s, bar, out| flux_vjp(&surface(), s, bar, K, out),
            |d, bar, out| flux_hvp(&surface(), &sources(&start()), d, bar, K, out), c),
        "kernel::normal::normal_jvp" => |c| forward(normal_matrix, |d, a, out| normal_jvp(&points(), &sources(&start()), d, a, K, out), c),
        "kernel::normal::normal_vjp" => |c| gradient(normal_matrix, |bar, out| normal_vjp(&points(), &sources(&start()), bar, K, out), c),
        "kernel::normal::normal_hvp" => |c| tangent(points().len(),
            |s, bar, out| normal_vjp(&points(), s, bar, K, out),
            |d, bar, out| normal_hvp(&points(), &sources(&start()), d, bar, K, out), c),
        "kernel::double::double_jvp" => |c| forward(double_matrix, |d, a, out| double_jvp(&panels(), &sources(&start()), d, a, K, out), c),
        "kernel::double::double_vjp" => |c| gradient(double_matrix, |bar, out| double_vjp(&panels(), &sources(&start()), bar, K, out), c),
        "kernel::double::double_hvp" => |c| tangent(panels().len(),
            |s, bar, out| double_vjp(&panels(), s, bar, K, out),
            |d, bar, out| double_hvp(&panels(), &sources(&start()), d, bar, K, out), c),
        "kernel::single::single_jvp" => |c| forward(single_matrix, |d, a, out| single_jvp(&panels(), &sources(&start()), d, a, K, out), c),
        "kernel::single::single_vjp" => |c| gradient(single_matrix, |bar, out| single_vjp(&panels(), &sources(&start()), bar, K, out), c),
        "kernel::single::single_hvp" => |c| tangent(panels().len(),
            |s, bar, out| single_vjp(&panels(), s, bar, K, out),
            |d, bar, out| single_hvp(&panels(), &sources(&start()), d, bar, K, out), c),
        "kernel::corner::corner_vjp" => |c| corners(Form::Closed, c).worst(corners(Form::Blended, c)),
        "kernel::corner::corner_hvp" => |c| corner_tangent(Form::Closed, c).worst(corner_tangent(Form::Blended, c)),
        "kernel::corner::layers_vjp" => |c| gradient(|s| closed_rows(&panels(), s).concat(), |bar, out| {
            let (single, double) = bar.split_at(bar.len() / 2);
            layers_vjp(&panels(), &sources(&start()), single, double, K, out);
        }, c),
        "kernel::potential::potential_jvp" => |c| forward(potential_matrix, |d, a, out| potential_jvp(&points(), &sources(&start()), d, a, K, out), c),
        "kernel::potential::potential_vjp" => |c| gradient(potential_matrix, |bar, out| potential_vjp(&points(), &sources(&start()), bar, K, out), c),
        "kernel::potential::potential_hvp" => |c| tangent(points().len(),
            |s, bar, out| potential_vjp(&points(), s, bar, K, out),
            |d, bar, out| potential_hvp(&points(), &sources(&start()), d, bar, K, out), c),
    ]
}

/// `K a` against `_jvp`, along the displacement of the sources.
fn forward(
    matrix: fn(&Sources) -> Vec<f64>,
    jvp: fn(&[Vec3], &[f64], &mut [f64]),
    corruption: f64,
) -> Outcome {
    let (x, dx, a) = (start(), numbers(3, 3 * N, 0.3), numbers(4, N * K, 1.0));
    let value = |x: &[f64]| {
        let matrix = matrix(&sources(x));
        let mut out = vec![0.0; matrix.len() / N * K];
        for (row, out) in matrix.chunks(N).zip(out.chunks_mut(K)) {
            for (entry, a) in row.iter().zip(a.chunks(K)) {
                for k in 0..K {
                    out[k] += entry * a[k];
                }
            }
        }
        out
    };
    let mut out = vec![0.0; value(&x).len()];
    jvp(&vectors(&dx), &a, &mut out);
    out.iter_mut().for_each(|o| *o *= corruption);
    outcome(value, &x, &dx, &out, TOLERANCE)
}

/// `barᵀ K a` against `_vjp` contracted with `a`.
fn gradient(
    matrix: fn(&Sources) -> Vec<f64>,
    vjp: fn(&[f64], &mut [f64]),
    corruption: f64,
) -> Outcome {
    let (x, dx, a) = (start(), numbers(3, 3 * N, 0.3), numbers(4, N * K, 1.0));
    let bar = numbers(5, matrix(&sources(&x)).len() / N * K, 1.0);
    let value = |x: &[f64]| {
        let mut sum = 0.0;
        for (row, bar) in matrix(&sources(x)).chunks(N).zip(bar.chunks(K)) {
            for (entry, a) in row.iter().zip(a.chunks(K)) {
                for k in 0..K {
                    sum += bar[k] * entry * a[k];
                }
            }
        }
        vec![sum]
    };
    let mut out = vec![0.0; N * K * 3];
    vjp(&bar, &mut out);
    let mut slope = 0.0;
    for (g, (j, a)) in out
        .chunks(3)
        .zip(a.iter().enumerate().map(|(n, a)| (n / K, a)))
    {
        slope += corruption * a * (0..3).map(|c| g[c] * dx[3 * j + c]).sum::<f64>();
    }
    outcome(value, &x, &dx, &[slope], TOLERANCE)
}

/// `_vjp` against `_hvp`.
fn tangent(
    rows: usize,
    vjp: fn(&Sources, &[f64], &mut [f64]),
    hvp: fn(&[Vec3], &[f64], &mut [f64]),
    corruption: f64,
) -> Outcome {
    let (x, dx) = (start(), numbers(3, 3 * N, 0.3));
    let bar = numbers(5, rows * K, 1.0);
    let value = |x: &[f64]| {
        let mut out = vec![0.0; N * K * 3];
        vjp(&sources(x), &bar, &mut out);
        out
    };
    let mut out = vec![0.0; N * K * 3];
    hvp(&vectors(&dx), &bar, &mut out);
    out.iter_mut().for_each(|o| *o *= corruption);
    outcome(value, &x, &dx, &out, TOLERANCE)
}

/// `Σ_jk bar[i][k] (S_ij + Ω_ij) a[j][k]` of each panel, unlike factors for S and Ω, against `corner_vjp`, along a motion of all vertices.
fn corners(form: Form, corruption: f64) -> Outcome {
    let (vertices, faces) = two_octahedra();
    let x: Vec<f64> = vertices.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    let (mut dx, a) = (numbers(3, x.len(), 0.1), numbers(4, N * K, 1.0));
    // The small one's by as much of its size.
    dx[..18].iter_mut().for_each(|x| *x *= 0.17);
    let bar = [5, 6].map(|seed| numbers(seed, faces.len() * K, 1.0));
    let points = sources(&start());
    let value = |x: &[f64]| {
        let triangles = panels_at(&vectors(x));
        let matrices = match form {
            Form::Blended => [
                single_rows(&triangles, &points),
                double_rows(&triangles, &points),
            ],
            Form::Closed => closed_rows(&triangles, &points),
        };
        let mut out = vec![0.0; triangles.len()];
        for (matrix, bar) in matrices.iter().zip(&bar) {
            for ((row, bar), out) in matrix.chunks(N).zip(bar.chunks(K)).zip(&mut out) {
                for (entry, a) in row.iter().zip(a.chunks(K)) {
                    *out += (0..K).map(|k| bar[k] * entry * a[k]).sum::<f64>();
                }
            }
        }
        out
    };
    let mut sums = vec![CornerSums::default(); faces.len() * K];
    corner_vjp(&panels(), &points, form, &a, K, &mut sums);
    let rates = vectors(&dx);
    let mut slopes = vec![0.0; faces.len()];
    for (n, sum) in sums.iter().enumerate() {
        for (k, v) in faces[n / K].iter().enumerate() {
            let single = bar[0][n] * sum.single_corners[k].dot(&rates[*v]);
            slopes[n / K] +=
                corruption * (single + bar[1][n] * sum.double_corners[k].dot(&rates[*v]));
        }
    }
    outcome(value, &x, &dx, &slopes, TOLERANCE)
}

/// `corner_vjp` against `corner_hvp`.
fn corner_tangent(form: Form, corruption: f64) -> Outcome {
    let (x, dx, a) = (start(), numbers(3, 3 * N, 0.3), numbers(4, N * K, 1.0));
    let panels = panels();
    let flat = |sums: &[CornerSums]| -> Vec<f64> {
        let of = |s: &CornerSums| {
            let corners = s.single_corners.into_iter().chain(s.double_corners);
            let corners: Vec<f64> = corners.flat_map(|v| [v.x, v.y, v.z]).collect();
            std::iter::once(s.single).chain(corners)
        };
        sums.iter().flat_map(of).collect()
    };
    let value = |x: &[f64]| {
        let mut out = vec![CornerSums::default(); panels.len() * K];
        corner_vjp(&panels, &sources(x), form, &a, K, &mut out);
        flat(&out)
    };
    let mut out = vec![CornerSums::default(); panels.len() * K];
    corner_hvp(&panels, &sources(&x), form, &vectors(&dx), &a, K, &mut out);
    let out: Vec<f64> = flat(&out).iter().map(|o| corruption * o).collect();
    outcome(value, &x, &dx, &out, TOLERANCE)
}

fn flux_matrix(s: &Sources) -> Vec<f64> {
    let t = surface();
    let mut out = vec![0.0; t.len() * s.len()];
    flux_fill(&t, s, Write::Set, &mut out, s.len(), 0);
    out
}

fn double_matrix(s: &Sources) -> Vec<f64> {
    double_rows(&panels(), s)
}

fn double_rows(t: &Triangles, s: &Sources) -> Vec<f64> {
    let mut out = vec![0.0; t.len() * s.len()];
    double_fill(t, s, Write::Set, &mut out, s.len(), 0);
    out
}

/// Single and double layer in closed form.
fn closed_rows(t: &Triangles, s: &Sources) -> [Vec<f64>; 2] {
    [single, flux].map(|f| {
        let row = |i: usize| {
            let of = move |j| f(&t.corners(i), t.weights()[i], &s.point(j));
            (0..s.len()).map(of)
        };
        (0..t.len()).flat_map(row).collect()
    })
}

fn single_matrix(s: &Sources) -> Vec<f64> {
    single_rows(&panels(), s)
}

fn single_rows(t: &Triangles, s: &Sources) -> Vec<f64> {
    let mut rows = vec![0.0; t.len() * s.len()];
    for (i, row) in rows.chunks_mut(s.len()).enumerate() {
        let mut unit = vec![0.0; t.len()];
        unit[i] = 1.0;
        single_sum(t, s, &unit, 1, row);
    }
    rows
}

fn normal_matrix(s: &Sources) -> Vec<f64> {
    let t = points();
    let mut out = vec![0.0; t.len() * s.len()];
    normal_fill(&t, s, Write::Set, &mut out, s.len(), 0);
    out
}

fn potential_matrix(s: &Sources) -> Vec<f64> {
    let t = points();
    let mut out = vec![0.0; t.len() * s.len()];
    potential_fill(&t, s, Write::Set, &mut out, s.len(), 0);
    out
}

/// Octahedron of unequal axes with row weights.
fn surface() -> Triangles {
    let (vertices, faces) = octahedron();
    let weights = (0..8).map(|i| 0.8 + 0.1 * i as f64).collect();
    Triangles::new(&vertices, &faces, weights)
}

/// The octahedron and a small one, which is farther in its own size: some of its faces are near, some far, some between.
fn panels() -> Triangles {
    panels_at(&two_octahedra().0)
}

fn panels_at(vertices: &[Vec3]) -> Triangles {
    let weights = (0..16).map(|i| 0.8 + 0.1 * i as f64).collect();
    Triangles::new(vertices, &two_octahedra().1, weights)
}

fn two_octahedra() -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let (mut vertices, mut faces) = octahedron();
    let small = vertices
        .iter()
        .map(|v| 0.17 * v + Vec3::new(0.5, -0.7, 0.6));
    vertices = small.chain(vertices.iter().copied()).collect();
    faces.extend(faces.clone().iter().map(|f| f.map(|v| v + 6)));
    (vertices, faces)
}

fn octahedron() -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let vertices = [
        Vec3::new(1.0, 0.1, 0.0),
        Vec3::new(0.0, 1.3, 0.1),
        Vec3::new(-1.1, 0.0, 0.0),
        Vec3::new(0.1, -1.2, 0.0),
        Vec3::new(0.0, 0.0, 0.9),
        Vec3::new(0.1, 0.05, -1.0),
    ];
    let faces = [
        [0, 1, 4],
        [1, 2, 4],
        [2, 3, 4],
        [3, 0, 4],
        [1, 0, 5],
        [2, 1, 5],
        [3, 2, 5],
        [0, 3, 5],
    ];
    (vertices.to_vec(), faces.to_vec())
}

/// Centroids of [`surface`].
fn points() -> Points {
    let t = surface();
    let centres: Vec<Vec3> = (0..t.len()).map(|i| t.centroid(i)).collect();
    let normals: Vec<Vec3> = (0..t.len()).map(|i| t.normal(i)).collect();
    Points::new(&centres, &normals, t.weights().to_vec())
}

/// Coordinates of sources near the origin, `[source][3]`.
fn start() -> Vec<f64> {
    numbers(2, 3 * N, 0.2)
}

fn vectors(x: &[f64]) -> Vec<Vec3> {
    x.chunks(3).map(Vec3::from_column_slice).collect()
}

fn sources(x: &[f64]) -> Sources {
    Sources::new(&vectors(x))
}
