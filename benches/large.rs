//! One body of more faces than a factor is made for: conjugate gradients on Eq. 20 with nothing of the size of a matrix, preconditioned by its sparse factor
//! ([CSD24]) and by the diagonal.
//!
//! `cargo bench --bench large [-- FACES … [--loose]]` (default 20000 50000; 100000 takes a quarter of an hour on two cores with `--loose`, hours without). An ellipsoid of
//! 1 : 0.2 : 1 that moves in all six ways. Times are those in which the residual ‖g − KᵀK x‖/‖g‖ fell to the paper's tolerance 2.7e-3 and to 1e-6, `--loose` to the first
//! alone, set-up counted; the diagonal is given up after twice the time that the sparse factor took.

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

const SIZES: [usize; 2] = [20_000, 50_000];
const TOLERANCES: [f64; 2] = [2.7e-3, 1e-6];
/// Columns of the right-hand side: all twists of the body.
const COLUMNS: usize = 6;
const RHO: f64 = 3.0;
/// Iterations after which the residual is looked at again, which takes as long as one.
const AGAIN: usize = 4;
/// Columns of K that are made at once.
const CHUNK: usize = 32;
/// The diagonal is given up after so many times as long.
const LONGER: f64 = 2.0;

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

    fn apply(&self, x: &Columns) -> Columns {
        let zero = || vec![0.0; self.0.faces.len() * COLUMNS];
        let add = |mut y: Vec<f64>, at: usize| {
            let (first, rows, width) = self.chunk(at);
            let x = x.slice(&(first..first + width));
            for (y, row) in y.chunks_exact_mut(COLUMNS).zip(rows.chunks_exact(width)) {
                for (k, x) in row.iter().zip(x.chunks_exact(COLUMNS)) {
                    y.iter_mut().zip(x).for_each(|(y, x)| *y += k * x);
                }
            }
            y
        };
        let both = |mut a: Vec<f64>, b: Vec<f64>| {
            a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
            a
        };
        let chunks = (0..self.chunks()).into_par_iter();
        columns(chunks.fold(zero, add).reduce(zero, both))
    }

    fn apply_transpose(&self, y: &Columns) -> Columns {
        let sums = |at: usize| {
            let (_, rows, width) = self.chunk(at);
            let mut sums = vec![0.0; width * COLUMNS];
            for (row, y) in rows.chunks_exact(width).zip(y.data.chunks_exact(COLUMNS)) {
                for (sums, k) in sums.chunks_exact_mut(COLUMNS).zip(row) {
                    sums.iter_mut().zip(y).for_each(|(s, y)| *s += k * y);
                }
            }
            sums
        };
        let chunks = (0..self.chunks()).into_par_iter();
        columns(chunks.flat_map_iter(sums).collect())
    }

    /// (KᵀK + D²) x.
    fn normal(&self, x: &Columns) -> Columns {
        let mut out = self.apply_transpose(&self.apply(x));
        let rows = out.data.chunks_exact_mut(COLUMNS);
        for ((o, x), d) in (rows.zip(x.data.chunks_exact(COLUMNS))).zip(&self.0.damping) {
            o.iter_mut().zip(x).for_each(|(o, x)| *o += d * d * x);
        }
        out
    }

    /// One over the norms of its columns.
    fn diagonal(&self) -> Vec<f64> {
        let squares = |at: usize| {
            let (first, rows, width) = self.chunk(at);
            let damping = &self.0.damping[first..first + width];
            let mut squares: Vec<f64> = damping.iter().map(|d| d * d).collect();
            for row in rows.chunks_exact(width) {
                squares.iter_mut().zip(row).for_each(|(s, k)| *s += k * k);
            }
            squares
        };
        let all = (0..self.chunks()).into_par_iter().flat_map_iter(squares);
        all.map(|s| 1.0 / s.sqrt()).collect()
    }
}

fn columns(data: Vec<f64>) -> Columns {
    Columns {
        rows: data.len() / COLUMNS,
        columns: COLUMNS,
        data,
    }
}

/// Iterations and seconds, and the residual then.
type Seen = (usize, f64, f64);

/// What was seen on the way, to the last tolerance or until `longest` (s) has passed.
fn solve(
    k: &MatrixFree,
    g: &Columns,
    (tolerance, longest): (f64, f64),
    precondition: impl Fn(&mut Columns),
    precondition_transpose: impl Fn(&mut Columns),
) -> Vec<Seen> {
    let start = Instant::now();
    let (mut looking, mut seen) = (0.0, Vec::new());
    let watch = |iteration: usize, x: &Columns| {
        let taken = start.elapsed().as_secs_f64() - looking;
        if !iteration.is_multiple_of(AGAIN) && taken < longest {
            return true;
        }
        let now = Instant::now();
        let made = k.normal(x);
        let residual = (made.as_mat() - g.as_mat()).norm_l2() / g.as_mat().norm_l2();
        seen.push((iteration, taken, residual));
        looking += now.elapsed().as_secs_f64();
        residual > tolerance && taken < longest
    };
    let normal = |x: &Columns| k.normal(x);
    let limits = (1e-14, 5000);
    cgls_watched(
        normal,
        precondition,
        precondition_transpose,
        g,
        limits,
        watch,
    );
    seen
}

/// A line of the table: where each tolerance was met.
fn print(name: &str, setup: f64, seen: &[Seen], tolerances: &[f64]) {
    print!("| {name} | {setup:.1} |");
    for tolerance in tolerances {
        match seen.iter().find(|s| s.2 <= *tolerance) {
            Some((iterations, taken, _)) => print!(" {iterations} | {:.1} |", setup + taken),
            None => match seen.last() {
                Some((iterations, taken, residual)) => {
                    print!(
                        " {residual:.0e} after {iterations} | {:.1} |",
                        setup + taken
                    );
                }
                None => print!(" – | – |"),
            },
        }
    }
    println!();
}

fn measure(faces: usize, tolerances: &[f64]) -> hydrograd::Result<()> {
    let shape = Shape::ellipsoid([0.4, 0.08, 0.4]);
    let mesh = shape::build(&shape, Path::new("."), Some(faces))?;
    let body = BodyBoundary::unfactored("coin", &mesh, &MfsSettings::default())?;
    let k = MatrixFree(&body);
    let asked = body.twist_rows.iter().flat_map(|row| row.iter().copied());
    let g = k.apply_transpose(&columns(asked.collect()));
    let last = tolerances.iter().copied().fold(1.0, f64::min);
    let start = Instant::now();
    let factor = body.sparse_factor(RHO)?;
    let setup = start.elapsed().as_secs_f64();
    let seen = solve(
        &k,
        &g,
        (last, f64::INFINITY),
        |x| *x = factor.apply(x),
        |x| *x = factor.apply_transpose(x),
    );
    let (faces, unknowns) = (body.faces.len(), body.sources.len());
    print!("| {faces} | {unknowns} ");
    print("csd24", setup, &seen, tolerances);
    let longest = LONGER * (setup + seen.last().map_or(0.0, |s| s.1));
    let start = Instant::now();
    let scales = k.diagonal();
    let setup = start.elapsed().as_secs_f64();
    let scale = |x: &mut Columns| {
        let rows = x.data.chunks_exact_mut(COLUMNS).zip(&scales);
        rows.for_each(|(row, s)| row.iter_mut().for_each(|x| *x *= s));
    };
    let seen = solve(&k, &g, (last, longest - setup), scale, scale);
    print!("| | ");
    print("jacobi", setup, &seen, tolerances);
    Ok(())
}

fn main() {
    let arguments = common::arguments();
    let loose = arguments.iter().any(|a| a == "--loose");
    let sizes = arguments.iter().filter(|a| *a != "--loose");
    let sizes: Vec<usize> = sizes
        .map(|a| a.parse().expect("numbers of faces, or --loose"))
        .collect();
    let tolerances = if loose { &TOLERANCES[..1] } else { &TOLERANCES };
    print!("| faces | unknowns | preconditioner | set-up, s |");
    (tolerances.iter()).for_each(|t| print!(" iterations to {t:.1e} | s, set-up counted |"));
    println!();
    println!("|---|---|---|---|{}", "---|---|".repeat(tolerances.len()));
    let sizes = if sizes.is_empty() {
        SIZES.to_vec()
    } else {
        sizes
    };
    for faces in sizes {
        if let Err(error) = measure(faces, tolerances) {
            println!("| {faces} | {error} |");
        }
    }
}
