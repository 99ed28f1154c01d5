//! The assembled matrix at given poses, and its solves.

use super::super::{FullSolver, MfsBody, Preconditioner, Reached};
use super::Cpu;
use crate::adjoint::kernel::Write;
use crate::adjoint::solve::{Fitted, Moved, Operator, least_squares, least_squares_jvp};
use crate::coupling::pair::Pair;
use crate::solver::{Columns, Outcome, cgls, gmres, normal_product, product, transposed_product};
use crate::{Error, Result};
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
            let own = &body.boundary.flux_rows;
            let width = body.sources();
            for (i, row) in own.chunks_exact(width).enumerate() {
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
        let mut out = Self {
            cpu,
            matrix,
            jacobi: Vec::new(),
            damping: model
                .bodies
                .iter()
                .flat_map(|b| b.boundary.damping.iter().map(|d| d * d))
                .collect(),
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

    /// Applies a body's factor to its rows of `x`.
    fn per_body(&self, x: &mut Columns, f: impl Fn(&MfsBody, MatMut<'_, f64>)) {
        let n = x.columns;
        for (body, range) in self.cpu.model.bodies.iter().zip(&self.cpu.model.sources) {
            let part = x.slice_mut(range.start, range.end);
            let part = MatMut::from_row_major_slice_mut(part, range.len(), n);
            f(body, part);
        }
    }

    fn scale(&self, x: &mut Columns) {
        let n = x.columns.max(1);
        for (row, s) in x.data.chunks_exact_mut(n).zip(&self.jacobi) {
            row.iter_mut().for_each(|v| *v *= s);
        }
    }

    fn precondition(&self, x: &mut Columns) {
        match self.cpu.model.settings.preconditioner {
            Preconditioner::Factors => self.per_body(x, |b, x| b.boundary.solve_factor(x)),
            Preconditioner::Jacobi => self.scale(x),
            Preconditioner::None => {}
        }
    }

    fn precondition_transpose(&self, x: &mut Columns) {
        match self.cpu.model.settings.preconditioner {
            Preconditioner::Factors => {
                self.per_body(x, |b, x| b.boundary.solve_factor_transpose(x));
            }
            Preconditioner::Jacobi => self.scale(x),
            Preconditioner::None => {}
        }
    }

    /// `x ← K_bb⁻¹ x` per body, or its transpose, for square blocks: (R⁻¹R⁻ᵀ) Kᵀ and K (R⁻¹R⁻ᵀ).
    fn square_precondition(&self, x: &mut Columns, transpose: bool) {
        match self.cpu.model.settings.preconditioner {
            Preconditioner::Factors => self.per_body(x, |b, mut x| {
                let own = b.boundary.flux_matrix();
                let normal = |m: &mut Mat<f64>| {
                    b.boundary.solve_factor_transpose(m.as_mut());
                    b.boundary.solve_factor(m.as_mut());
                };
                if transpose {
                    let mut m = x.to_owned();
                    normal(&mut m);
                    x.copy_from(own * &m);
                } else {
                    let mut m = own.transpose() * x.as_ref();
                    normal(&mut m);
                    x.copy_from(&m);
                }
            }),
            Preconditioner::Jacobi => self.scale(x),
            Preconditioner::None => {}
        }
    }

    /// Solves `(KᵀK + D²) x = g`.
    fn normal_solve(&self, g: &Columns, what: &str) -> Result<Outcome> {
        let settings = &self.cpu.model.settings;
        if let Some(qr) = &self.qr {
            let mut x = g.as_mat().to_owned();
            let r = qr.thin_R();
            crate::boundary::solve_upper_transpose(r, x.as_mut());
            crate::boundary::solve_upper(r, x.as_mut());
            return Ok(Outcome {
                x: Columns::from_fn(g.rows, g.columns, |i, k| x[(i, k)]),
                iterations: 0,
                residual: 0.0,
            });
        }
        let outcome = cgls(
            |x| self.normal(x),
            |x| self.precondition(x),
            |x| self.precondition_transpose(x),
            g,
            settings.tolerance,
            settings.max_iterations,
        );
        self.check(outcome, what)
    }

    fn check(&self, outcome: Outcome, what: &str) -> Result<Outcome> {
        let settings = &self.cpu.model.settings;
        // The recurrence's residual may stall a little above at round-off.
        if outcome.residual <= settings.tolerance.max(1e-13) * 1.001 {
            return Ok(outcome);
        }
        Err(Error::Solver {
            what: format!(
                "{what} ({} rows, {} unknowns)",
                self.cpu.model.rows(),
                self.cpu.model.columns()
            ),
            iterations: outcome.iterations,
            residual: outcome.residual,
            tolerance: settings.tolerance,
            remedy: "raise the tolerance, refine the meshes where bodies are close, or use the \
                     factors as preconditioner"
                .into(),
        })
    }

    fn square_solve(&self, b: &Columns, transpose: bool, what: &str) -> Result<Outcome> {
        let settings = &self.cpu.model.settings;
        let outcome = gmres(
            |x| {
                if transpose {
                    self.apply_transpose(x)
                } else {
                    self.apply(x)
                }
            },
            |x| self.square_precondition(x, transpose),
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
