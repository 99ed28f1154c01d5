//! Million target–source pairs a second of every kernel sum on one thread, and the time relative
//! to the value of the same kernel. Run with `cargo bench -p hydrograd-adjoint --bench kernels`.

use hydrograd_adjoint::kernel::*;
use hydrograd_adjoint::lie::Vec3;
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(run);
}

/// Best time of a call, s.
fn time(mut f: impl FnMut()) -> f64 {
    f();
    let mut best = f64::INFINITY;
    let start = Instant::now();
    while start.elapsed().as_secs_f64() < 0.4 {
        let once = Instant::now();
        f();
        best = best.min(once.elapsed().as_secs_f64());
    }
    best
}

/// Unit sphere of `n` by `2 n` patches of two triangles, without the slivers at the poles.
fn sphere(n: usize) -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let m = 2 * n;
    let mut vertices = Vec::new();
    for i in 0..=n {
        for j in 0..m {
            let (t, p) = (
                PI * (i as f64 + 0.5) / (n as f64 + 1.0),
                PI * j as f64 / n as f64,
            );
            vertices.push(Vec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos()));
        }
    }
    let mut faces = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i * m + j, i * m + (j + 1) % m);
            let (c, d) = (a + m, b + m);
            faces.extend([[a, c, b], [b, c, d]]);
        }
    }
    (vertices, faces)
}

fn run() {
    let (vertices, faces) = sphere(22);
    let triangles = Triangles::new(&vertices, &faces, vec![1.0; faces.len()]);
    let n = triangles.len();
    let centres: Vec<Vec3> = (0..n).map(|i| triangles.centroid(i)).collect();
    let normals: Vec<Vec3> = (0..n).map(|i| triangles.normal(i)).collect();
    let points = Points::new(&centres, &normals, vec![1.0; n]);
    let sources: Sources = centres.iter().step_by(2).map(|c| 0.85 * c).collect();
    let m = sources.len();
    let d: Vec<Vec3> = (0..m)
        .map(|j| Vec3::new(1.0, 0.1 * (j as f64).sin(), -0.5))
        .collect();
    let mut matrix = vec![0.0; n * m];
    println!("{n} targets, {m} sources, one thread: million pairs/s (time relative to the value)");

    let flux = time(|| {
        flux_fill(
            &triangles,
            &sources,
            Write::Set,
            black_box(&mut matrix),
            m,
            0,
        )
    });
    let normal = time(|| normal_fill(&points, &sources, Write::Set, black_box(&mut matrix), m, 0));
    let show = |name: &str, k: usize, time: f64, value: f64| {
        let speed = (n * m) as f64 / time * 1e-6;
        println!("{name:14} k = {k:2}  {speed:7.0}  ({:.2})", time / value);
    };
    show("flux_fill", 1, flux, flux);
    show("normal_fill", 1, normal, normal);
    for k in [1, 5, 12, 20] {
        let bar: Vec<f64> = (0..n * k).map(|i| (i as f64).sin()).collect();
        let a: Vec<f64> = (0..m * k).map(|i| (i as f64).cos()).collect();
        let mut rows = vec![0.0; n * k];
        let mut scalars = vec![0.0; m * k];
        let mut vectors = vec![0.0; m * k * 3];
        let (rows, vectors) = (black_box(&mut rows), black_box(&mut vectors));
        let t = time(|| flux_jvp(&triangles, &sources, &d, &a, k, rows));
        show("flux_jvp", k, t, flux);
        let t = time(|| flux_vjp(&triangles, &sources, &bar, k, vectors));
        show("flux_vjp", k, t, flux);
        let t = time(|| flux_hvp(&triangles, &sources, &d, &bar, k, vectors));
        show("flux_hvp", k, t, flux);
        let t = time(|| normal_jvp(&points, &sources, &d, &a, k, rows));
        show("normal_jvp", k, t, normal);
        let t = time(|| normal_vjp(&points, &sources, &bar, k, vectors));
        show("normal_vjp", k, t, normal);
        let t = time(|| normal_hvp(&points, &sources, &d, &bar, k, vectors));
        show("normal_hvp", k, t, normal);
        let value = time(|| potential_sum(&points, &sources, &bar, k, black_box(&mut scalars)));
        show("potential_sum", k, value, value);
        let t = time(|| potential_vjp(&points, &sources, &bar, k, vectors));
        show("potential_vjp", k, t, value);
        let t = time(|| potential_hvp(&points, &sources, &d, &bar, k, vectors));
        show("potential_hvp", k, t, value);
    }
}
