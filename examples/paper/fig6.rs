//! Figure 6: how fast conjugate gradients on Eq. 20 converge with each preconditioner, on the falling ball with its floor as a box.
//!
//! The residual is ‖g − KᵀK x‖/‖g‖ over all columns, whatever the preconditioner's own norm is.

use crate::meshed::System;
use crate::plot::{Curve, Panel, draw};
use crate::{How, Made, Numbers};
use hydrograd::solver::{Columns, InverseCholesky, cgls_watched};
use serde_json::json;
use std::ops::Range;
use std::time::Instant;

/// Relative residuals: the paper's, and one for gradients.
const TOLERANCES: [f64; 2] = [2.7e-3, 1e-8];
/// Iterations after which a preconditioner is given up.
const MOST: usize = 3000;
/// The residual is looked at again after so many iterations more, relative to those made: looking takes as long as an iteration.
const AGAIN: f64 = 0.05;
/// Faces of a body where it is quick.
const QUICK: usize = 320;
/// ρ of the sparse factors.
const RHOS: [f64; 3] = [1.2, 2.0, 3.0];

/// A right preconditioner, applied as R⁻¹ and R⁻ᵀ.
enum Preconditioner<'a> {
    None,
    Diagonal(Vec<f64>),
    /// Over the sources of all bodies, or one for each body's.
    Sparse(Vec<(Range<usize>, InverseCholesky)>),
    Factors(&'a System),
}

impl Preconditioner<'_> {
    fn apply(&self, x: &mut Columns, transpose: bool) {
        let n = x.columns;
        match self {
            Self::None => {}
            Self::Diagonal(scales) => {
                for (row, scale) in x.data.chunks_exact_mut(n).zip(scales) {
                    row.iter_mut().for_each(|v| *v *= scale);
                }
            }
            Self::Sparse(parts) => {
                for (range, factor) in parts {
                    let part = x.part(range);
                    let made = match transpose {
                        true => factor.apply_transpose(&part),
                        false => factor.apply(&part),
                    };
                    x.slice_mut(range).copy_from_slice(&made.data);
                }
            }
            Self::Factors(system) => {
                for (body, range) in system.bodies.iter().zip(&system.sources) {
                    let mut part = x.part(range);
                    match transpose {
                        true => body.solve_factor_transpose(part.as_mat_mut()),
                        false => body.solve_factor(part.as_mat_mut()),
                    }
                    x.slice_mut(range).copy_from_slice(&part.data);
                }
            }
        }
    }
}

/// One solve, watched: iterations, seconds with the set-up, and residual.
struct Watched {
    setup: f64,
    points: Vec<(usize, f64, f64)>,
}

impl Watched {
    fn of(system: &System, g: &Columns, setup: f64, preconditioner: &Preconditioner) -> Self {
        let mut points = Vec::new();
        let start = Instant::now();
        let (mut looking, mut next) = (0.0, 1);
        let watch = |iteration: usize, x: &Columns| {
            if iteration < next {
                return true;
            }
            next = iteration + 1 + (AGAIN * iteration as f64) as usize;
            let now = Instant::now();
            let at = setup + start.elapsed().as_secs_f64() - looking;
            let residual = residual(&system.normal(x), g);
            points.push((iteration, at, residual));
            looking += now.elapsed().as_secs_f64();
            residual > TOLERANCES[1]
        };
        cgls_watched(
            |x| system.normal(x),
            |x| preconditioner.apply(x, false),
            |x| preconditioner.apply(x, true),
            g,
            (1e-14, MOST),
            watch,
        );
        Self { setup, points }
    }

    fn reached(&self, tolerance: f64) -> Option<&(usize, f64, f64)> {
        self.points.iter().find(|p| p.2 <= tolerance)
    }

    fn numbers(&self) -> Numbers {
        let mut out = Numbers::new();
        out.insert("setup_s".into(), json!(self.setup));
        for tolerance in TOLERANCES {
            let reached = self.reached(tolerance);
            let name = |what: &str| format!("{what}_to_{tolerance:.1e}");
            out.insert(name("iterations"), json!(reached.map(|p| p.0)));
            out.insert(name("seconds"), json!(reached.map(|p| p.1)));
        }
        out
    }
}

fn residual(made: &Columns, g: &Columns) -> f64 {
    (made.as_mat() - g.as_mat()).norm_l2() / g.as_mat().norm_l2()
}

/// What takes so long to be made.
fn timed<T>(make: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = make();
    (start.elapsed().as_secs_f64(), made)
}

pub fn make(how: &How) -> Made {
    let system = System::falling_ball(how.quick.then_some(QUICK))?;
    let g = system.right_sides();
    let mut runs: Vec<(String, Watched)> = Vec::new();
    let mut run = |name: String, setup: f64, with: &Preconditioner| {
        runs.push((name, Watched::of(&system, &g, setup, with)));
    };
    run("none".into(), 0.0, &Preconditioner::None);
    let (setup, scales) = timed(|| system.diagonal());
    run("Jacobi".into(), setup, &Preconditioner::Diagonal(scales));
    let all = 0..system.points.len();
    for rho in RHOS {
        let (setup, factor) = timed(|| system.sparse(rho));
        let made = Preconditioner::Sparse(vec![(all.clone(), factor)]);
        run(format!("CSD24, rho {rho}"), setup, &made);
    }
    let own = |b: usize| system.bodies[b].sparse_factor(RHOS[2]);
    let (setup, own) = timed(|| {
        (0..system.bodies.len())
            .map(own)
            .collect::<Result<Vec<_>, _>>()
    });
    let own = system.sources.iter().cloned().zip(own?).collect();
    let name = format!("CSD24 per body, rho {}", RHOS[2]);
    run(name, setup, &Preconditioner::Sparse(own));
    run(
        "factors per body".into(),
        system.factored_in,
        &Preconditioner::Factors(&system),
    );
    let mut numbers = Numbers::new();
    numbers.insert("faces".into(), json!(system.rows));
    numbers.insert("unknowns".into(), json!(system.points.len()));
    let (mut by_iteration, mut by_time) = (Vec::new(), Vec::new());
    for (name, run) in &runs {
        numbers.insert(name.clone(), json!(run.numbers()));
        let of =
            |f: &dyn Fn(&(usize, f64, f64)) -> f64| run.points.iter().map(f).collect::<Vec<_>>();
        let residuals = of(&|p| p.2);
        by_iteration.push(Curve::new(name, &of(&|p| p.0 as f64), &residuals));
        by_time.push(Curve::new(name, &of(&|p| p.1), &residuals));
    }
    draw(
        how.picture,
        &[
            Panel::logarithmic("residual of Eq. 20", "iterations", by_iteration),
            Panel::logarithmic("residual, set-up counted", "time, s", by_time),
        ],
    )?;
    Ok(numbers)
}
