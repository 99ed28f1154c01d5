//! The assembled matrix at given poses, and its solves.

use super::super::{FullSolver, Preconditioner};
use super::Cpu;
use crate::Result;
use crate::adjoint::kernel::Write;
use crate::adjoint::solve::{Fitted, Moved, Operator, least_squares, least_squares_jvp};
use crate::boundary::{BodyBoundary, solve_upper, solve_upper_transpose};
use crate::coupling::Reached;
use crate::coupling::pair::Pair;
use crate::coupling::settings::converged;
use crate::solver::{
    Columns, InverseCholesky, Outcome, cgls, gmres, normal_product, product, transposed_product,
};
use faer::linalg::solvers::Qr;
use faer::{Mat, MatMut};

/// K at given poses with what its solver needs.
pub(super) struct System<'a> {
    cpu: &'a Cpu,
    matrix: Vec<f64>,
    jacobi: Vec<f64>,
    /// D² of the bodies' damping, per source.
    damping: Vec<f64>,
    qr: Option<Qr<f64>>,
}

impl Drop for System<'_> {
    fn drop(&mut self) {
        if let Ok(mut spare) = self.cpu.spare.lock() {
            spare.push(std::mem::take(&mut self.matrix));
        }
    }
}

/// Solutions a and λ with r and μ.
pub(super) type Solved = Fitted<Columns>;

impl Operator<Columns> for System<'_> {
    fn apply(&self, x: &Columns) -> Columns {
        product(&self.matrix, self.cpu.model.rows(), x)
    }

    fn apply_transpose(&self, y: &Columns) -> Columns {
        transposed_product(&self.matrix, self.cpu.model.columns(), y)
    }
}

impl<'a> System<'a> {
    /// Assembles K: own blocks from the bodies, zero for excluded pairs, all others from the pairs.
    pub fn new(cpu: &'a Cpu, pairs: &[Pair]) -> Self {
        let model = &cpu.model;
        let (rows, columns) = (model.rows(), model.columns());
        // Every entry is written below, so that what a used matrix held doesn't matter.
        let spare = cpu.spare.lock().ok().and_then(|mut s| s.pop());
        let mut matrix = spare.unwrap_or_else(|| vec![0.0; rows * columns]);
        for (b, body) in model.bodies.iter().enumerate() {
            let width = body.sources.len();
            for (i, row) in body.flux_rows.chunks_exact(width).enumerate() {
                let at = (model.faces[b].start + i) * columns + model.sources[b].start;
                matrix[at..at + width].copy_from_slice(row);
            }
        }
        for (a, b) in model.excluded.iter().flat_map(|(a, b)| [(a, b), (b, a)]) {
            for i in model.faces[a].clone() {
                let sources = &model.sources[b];
                matrix[i * columns + sources.start..i * columns + sources.end].fill(0.0);
            }
        }
        for pair in pairs {
            let rows = &model.faces[pair.target];
            let out = &mut matrix[rows.start * columns..rows.end * columns];
            // The first that is written there sets, the images after it add.
            let write = if pair.image.is_identity() {
                Write::Set
            } else {
                Write::Add
            };
            let column = model.sources[pair.source].start;
            model.bodies[pair.target].fill(&pair.points, write, out, columns, column);
        }
        let damping = model.bodies.iter().flat_map(|b| &b.damping);
        let mut out = Self {
            cpu,
            matrix,
            jacobi: Vec::new(),
            damping: damping.map(|d| d * d).collect(),
            qr: None,
        };
        let settings = &model.settings;
        if settings.solver == FullSolver::Qr {
            // [K; D], so that KᵀK + D² = RᵀR.
            let stacked = Mat::from_fn(rows + columns, columns, |i, j| {
                if i < rows {
                    out.matrix[i * columns + j]
                } else if i - rows == j {
                    out.damping[j].sqrt()
                } else {
                    0.0
                }
            });
            out.qr = Some(stacked.qr());
        } else if settings.preconditioner == Preconditioner::Jacobi {
            let mut norms = out.damping.clone();
            for row in out.matrix.chunks_exact(columns) {
                for (n, x) in norms.iter_mut().zip(row) {
                    *n += x * x;
                }
            }
            out.jacobi = norms.iter().map(|n| 1.0 / n.sqrt()).collect();
        }
        out
    }

    /// (KᵀK + D²) x.
    fn normal(&self, x: &Columns) -> Columns {
        let mut out = normal_product(&self.matrix, self.cpu.model.rows(), x);
        let n = x.columns.max(1);
        let rows = out.data.chunks_exact_mut(n).zip(x.data.chunks_exact(n));
        for ((o, x), d) in rows.zip(&self.damping) {
            for (o, x) in o.iter_mut().zip(x) {
                *o += d * x;
            }
        }
        out
    }

    /// Applies the preconditioner, `factor` a body's own to its rows of `x`, `sparse` where that is a sparse one.
    fn precondition(
        &self,
        x: &mut Columns,
        factor: impl Fn(&BodyBoundary, MatMut<'_, f64>),
        sparse: impl Fn(&BodyBoundary, &InverseCholesky, &Columns) -> Columns,
    ) {
        let (model, n) = (&self.cpu.model, x.columns);
        match model.settings.preconditioner {
            Preconditioner::Csd24 => {
                let bodies = model.bodies.iter().zip(&model.sparse_factors);
                for ((body, made), range) in bodies.zip(&model.sources) {
                    if let Some(made) = made {
                        let part = sparse(body, made, &x.part(range));
                        x.slice_mut(range).copy_from_slice(&part.data);
                    }
                }
            }
            Preconditioner::Factors => {
                for (body, range) in model.bodies.iter().zip(&model.sources) {
                    let part = x.slice_mut(range);
                    let part = MatMut::from_row_major_slice_mut(part, range.len(), n);
                    factor(body, part);
                }
            }
            Preconditioner::Jacobi => {
                for (row, s) in x.data.chunks_exact_mut(n.max(1)).zip(&self.jacobi) {
                    row.iter_mut().for_each(|v| *v *= s);
                }
            }
            Preconditioner::None => {}
        }
    }

    /// Solves `(KᵀK + D²) x = g`.
    fn normal_solve(&self, g: &Columns, what: &str) -> Result<Outcome> {
        let settings = &self.cpu.model.settings;
        if let Some(qr) = &self.qr {
            let mut x = g.as_mat().to_owned();
            solve_upper_transpose(qr.thin_R(), x.as_mut());
            solve_upper(qr.thin_R(), x.as_mut());
            return Ok(Outcome {
                x: Columns::from_fn(g.rows, g.columns, |i, k| x[(i, k)]),
                iterations: 0,
                residual: 0.0,
            });
        }
        let outcome = cgls(
            |x| self.normal(x),
            |x| self.precondition(x, |b, x| b.solve_factor(x), |_, l, x| l.apply(x)),
            |x| {
                let transposed = |b: &BodyBoundary, x: MatMut<'_, f64>| b.solve_factor_transpose(x);
                self.precondition(x, transposed, |_, l, x| l.apply_transpose(x));
            },
            g,
            settings.tolerance,
            settings.max_iterations,
        );
        self.check(outcome, what)
    }

    fn check(&self, outcome: Outcome, what: &str) -> Result<Outcome> {
        let model = &self.cpu.model;
        let (rows, columns) = (model.rows(), model.columns());
        let what = || format!("{what} ({rows} rows, {columns} unknowns)");
        let instead = "factors as preconditioner";
        converged(outcome, model.settings.tolerance, what, instead)
    }

    fn square_solve(&self, b: &Columns, transpose: bool, what: &str) -> Result<Outcome> {
        let settings = &self.cpu.model.settings;
        let outcome = gmres(
            |v, _| {
                let mut z = v.clone();
                self.precondition(
                    &mut z,
                    |b, x| solve_square(b, x, transpose),
                    |b, l, x| solve_square_sparse(b, l, x, transpose),
                );
                let image = match transpose {
                    true => self.apply_transpose(&z),
                    false => self.apply(&z),
                };
                [z, image]
            },
            b,
            settings.tolerance,
            settings.max_iterations,
            100,
        );
        self.check(outcome, what)
    }

    /// Solves for a and λ from `F x̄` and `Pᵀ B x̄`.
    pub fn respond(&self, f: &Columns, g: &Columns) -> Result<(Solved, Reached)> {
        if self.cpu.model.settings.solver == FullSolver::Gmres {
            let a = self.square_solve(f, false, "coupled system (Eq. 18)")?;
            let mu = self.square_solve(g, true, "transposed coupled system")?;
            return Ok(square(a, mu));
        }
        let normal = |b: &Columns| self.normal_solve(b, "coupled system (Eq. 20)").map(parts);
        least_squares(self, normal, f, g)
    }

    /// Tangents of the solutions.
    pub fn respond_jvp(&self, moved: &Moved<Columns>) -> Result<(Solved, Reached)> {
        if self.cpu.model.settings.solver == FullSolver::Gmres {
            let mut right = moved.a.clone();
            right.data.iter_mut().for_each(|x| *x = -*x);
            let a = self.square_solve(&right, false, "tangent of the coupled system (Eq. 21)")?;
            let mu =
                self.square_solve(moved.g, true, "transposed tangent of the coupled system")?;
            return Ok(square(a, mu));
        }
        let what = "tangent of the coupled system (Eq. 21)";
        let normal = |b: &Columns| self.normal_solve(b, what).map(parts);
        least_squares_jvp(self, normal, moved)
    }
}

/// `x ← K⁻¹ x` of a square block, or its transpose: (R⁻¹R⁻ᵀ) Kᵀ and K (R⁻¹R⁻ᵀ).
fn solve_square(body: &BodyBoundary, mut x: MatMut<'_, f64>, transpose: bool) {
    let own = body.flux_matrix();
    let mut m = match transpose {
        true => x.to_owned(),
        false => own.transpose() * x.as_ref(),
    };
    body.solve_factor_transpose(m.as_mut());
    body.solve_factor(m.as_mut());
    match transpose {
        true => x.copy_from(own * &m),
        false => x.copy_from(&m),
    }
}

/// As [`solve_square`], (L Lᵀ) Kᵀ x and K (L Lᵀ) x.
fn solve_square_sparse(
    body: &BodyBoundary,
    l: &InverseCholesky,
    x: &Columns,
    transpose: bool,
) -> Columns {
    let (rows, n) = (body.faces.len(), body.sources.len());
    if transpose {
        product(&body.flux_rows, rows, &l.apply(&l.apply_transpose(x)))
    } else {
        let x = transposed_product(&body.flux_rows, n, x);
        l.apply(&l.apply_transpose(&x))
    }
}

/// A solution, and what its solver reached.
fn parts(outcome: Outcome) -> (Columns, Reached) {
    let reached = Reached {
        iterations: outcome.iterations,
        residual: outcome.residual,
    };
    (outcome.x, reached)
}

/// Solutions of a square system, that leaves no residual, and of the transposed one.
fn square(a: Outcome, mu: Outcome) -> (Solved, Reached) {
    let ((a, first), (mu, second)) = (parts(a), parts(mu));
    let solved = Solved {
        lambda: Columns::zeros(a.rows, a.columns),
        r: Columns::zeros(mu.rows, mu.columns),
        a,
        mu,
    };
    (solved, first.worst(second))
}
