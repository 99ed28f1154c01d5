//! One body of more faces than a factor is made for: conjugate gradients on Eq. 20 with nothing of the size of a matrix, preconditioned by its sparse factor
//! ([CSD24]) and by the diagonal.
//!
//! `cargo bench --bench large [-- FACES …]` (default 20000 50000 100000; the last takes half an hour on two cores). An ellipsoid of 1 : 0.2 : 1 that heaves, one
//! right-hand side, to the paper's tolerance 2.7e-3 of the true residual, ‖g − KᵀK x‖ ≤ 2.7e-3 ‖g‖. The diagonal gets as long as the sparse factor took in all, its set-up
//! counted, or twice as long where that is minutes at most.

#[allow(dead_code)]
mod common;

use hydrograd::adjoint::kernel::{Sources, Write};
use hydrograd::boundary::{BodyBoundary, MfsSettings};
use hydrograd::scene::Shape;
use hydrograd::shape;
use hydrograd::solver::{Columns, cgls_watched};
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;

const SIZES: [usize; 3] = [20_000, 50_000, 100_000];
const TOLERANCE: f64 = 2.7e-3;
const RHO: f64 = 3.0;
/// Iterations after which the residual is looked at again, which takes as long as one.
const AGAIN: usize = 4;
/// Columns of K that are made at once.
const CHUNK: usize = 32;
/// Solves shorter than this (s) give the diagonal twice the time.
const SHORT: f64 = 200.0;

/// Columns of K by chunks, made again whenever they are wanted.
struct MatrixFree<'a>(&'a BodyBoundary);

impl MatrixFree<'_> {
    fn chunk(&self, at: usize) -> (usize, Vec<f64>, usize) {
        let body = self.0;
        let first = at * CHUNK;
        let sources = &body.sources[first..body.sources.len().min(first + CHUNK)];
        let mut rows = vec![0.0; body.faces.len() * sources.len()];
        let width = sources.len();
        body.fill(&Sources::new(sources), Write::Set, &mut rows, width, 0);
        (first, rows, width)
    }

    fn chunks(&self) -> usize {
        self.0.sources.len().div_ceil(CHUNK)
    }

    fn apply(&self, x: &[f64]) -> Vec<f64> {
        let zero = || vec![0.0; self.0.faces.len()];
        let add = |mut y: Vec<f64>, at: usize| {
            let (first, rows, width) = self.chunk(at);
            let x = &x[first..first + width];
            for (y, row) in y.iter_mut().zip(rows.chunks_exact(width)) {
                *y += row.iter().zip(x).map(|(k, x)| k * x).sum::<f64>();
            }
            y
        };
        let both = |mut a: Vec<f64>, b: Vec<f64>| {
            a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
            a
        };
        (0..self.chunks())
            .into_par_iter()
            .fold(zero, add)
            .reduce(zero, both)
    }

    /// Of each column, a sum over its entries with those of y.
    fn over_columns(&self, term: impl Fn(f64, usize) -> f64 + Sync) -> Vec<f64> {
        let sums = |at: usize| {
            let (_, rows, width) = self.chunk(at);
            let mut sums = vec![0.0; width];
            for (i, row) in rows.chunks_exact(width).enumerate() {
                sums.iter_mut()
                    .zip(row)
                    .for_each(|(s, k)| *s += term(*k, i));
            }
            sums
        };
        (0..self.chunks())
            .into_par_iter()
            .flat_map_iter(sums)
            .collect()
    }

    fn apply_transpose(&self, y: &[f64]) -> Vec<f64> {
        self.over_columns(|k, i| k * y[i])
    }

    /// (KᵀK + D²) x.
    fn normal(&self, x: &Columns) -> Columns {
        let mut out = self.apply_transpose(&self.apply(&x.data));
        let damping = &self.0.damping;
        for ((o, x), d) in out.iter_mut().zip(&x.data).zip(damping) {
            *o += d * d * x;
        }
        column(out)
    }
}

fn column(data: Vec<f64>) -> Columns {
    Columns {
        rows: data.len(),
        columns: 1,
        data,
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Iterations, seconds and residual where one of them stops it.
fn solve(
    k: &MatrixFree,
    g: &Columns,
    longest: f64,
    precondition: impl Fn(&mut Columns),
    precondition_transpose: impl Fn(&mut Columns),
) -> (usize, f64, f64) {
    let start = Instant::now();
    let (mut looking, mut last) = (0.0, (0, 0.0, 1.0));
    let watch = |iteration: usize, x: &Columns| {
        let taken = start.elapsed().as_secs_f64() - looking;
        if !iteration.is_multiple_of(AGAIN) && taken < longest {
            return true;
        }
        let now = Instant::now();
        let made = k.normal(x);
        let off: Vec<f64> = made.data.iter().zip(&g.data).map(|(a, b)| a - b).collect();
        last = (iteration, taken, norm(&off) / norm(&g.data));
        looking += now.elapsed().as_secs_f64();
        last.2 > TOLERANCE && taken < longest
    };
    let normal = |x: &Columns| k.normal(x);
    cgls_watched(
        normal,
        precondition,
        precondition_transpose,
        g,
        (1e-14, 5000),
        watch,
    );
    last
}

fn measure(faces: usize) -> hydrograd::Result<()> {
    let shape = Shape::ellipsoid([0.4, 0.08, 0.4]);
    let mesh = shape::build(&shape, Path::new("."), Some(faces))?;
    let body = BodyBoundary::unfactored("coin", &mesh, &MfsSettings::default())?;
    let k = MatrixFree(&body);
    let heave: Vec<f64> = body.twist_rows.iter().map(|row| row[1]).collect();
    let g = column(k.apply_transpose(&heave));
    let start = Instant::now();
    let factor = body.sparse_factor(RHO)?;
    let setup = start.elapsed().as_secs_f64();
    let (count, taken, reached) = solve(
        &k,
        &g,
        f64::INFINITY,
        |x| *x = factor.apply(x),
        |x| *x = factor.apply_transpose(x),
    );
    let (faces, unknowns) = (body.faces.len(), body.sources.len());
    let entries = factor.rows().entries() as f64 / unknowns as f64;
    println!(
        "| {faces} | {unknowns} | csd24 ({entries:.0} entries a column) | {setup:.1} | {count} | {:.1} | {reached:.1e} |",
        setup + taken
    );
    let start = Instant::now();
    let squares = k.over_columns(|k, _| k * k);
    let damped = squares.iter().zip(&body.damping).map(|(s, d)| s + d * d);
    let scales: Vec<f64> = damped.map(|s| 1.0 / s.sqrt()).collect();
    let diagonal = start.elapsed().as_secs_f64();
    let scale = |x: &mut Columns| x.data.iter_mut().zip(&scales).for_each(|(x, s)| *x *= s);
    let whole = setup + taken;
    let longest = if whole < SHORT { 2.0 * whole } else { whole };
    let (count, taken, reached) = solve(&k, &g, longest - diagonal, scale, scale);
    println!(
        "| | | jacobi | {diagonal:.1} | {count} | {:.1} | {reached:.1e} |",
        diagonal + taken
    );
    Ok(())
}

fn main() {
    let sizes: Vec<usize> = common::arguments()
        .iter()
        .filter_map(|a| a.parse().ok())
        .collect();
    println!("| faces | unknowns | preconditioner | set-up, s | iterations | all, s | residual |");
    println!("|---|---|---|---|---|---|---|");
    for faces in if sizes.is_empty() {
        SIZES.to_vec()
    } else {
        sizes
    } {
        if let Err(error) = measure(faces) {
            println!("| {faces} | {error} ||||||");
        }
    }
}
